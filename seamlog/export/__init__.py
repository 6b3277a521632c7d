"""Sessions to the formats of others; each format is one function of a session window."""
