"""Sessions of robotic seam-tracking welds: record, analyse, replay and report."""
