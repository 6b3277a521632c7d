"""Estimators of the table's parameters, found by name."""
