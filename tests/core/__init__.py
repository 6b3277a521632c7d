"""Tests of the core: codec, sessions, results, commands."""
