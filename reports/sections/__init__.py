"""Sections of the report, one plug-in each: the runs of a report to blocks of content."""
