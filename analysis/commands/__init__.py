"""Commands of the analysis: identify, replay and analyze."""
