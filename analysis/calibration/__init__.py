"""Calibration: photos of boards, rulers and known points to calibration files."""
