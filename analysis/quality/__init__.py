"""Quality: the user's limits and the rows of a standard against what was measured."""
