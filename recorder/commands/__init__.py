"""Commands of the live side, one module each."""
