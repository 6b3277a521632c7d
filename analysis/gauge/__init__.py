"""Gauge: how much of a measured difference is the measurement's own (gauge R&R)."""
