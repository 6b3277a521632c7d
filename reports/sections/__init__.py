"""Sections of the report, found by name."""
