"""Tests of the bead: photos, strip, toes, width, results."""
