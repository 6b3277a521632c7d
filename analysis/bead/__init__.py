"""Bead metrology from photos: strip, toes, width and its uniformity."""
