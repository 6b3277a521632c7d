"""Controllers that a replay or the virtual cell can run, found by name."""
