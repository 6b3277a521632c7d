"""Commands of the core: they chain other commands by name or move data."""
