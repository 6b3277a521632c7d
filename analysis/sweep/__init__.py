"""Sweeps: many tunings of controllers predicted from recorded welds, ranked with their doubt."""
