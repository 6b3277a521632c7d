"""Importers: foreign logs become sessions, with a report of what was left behind."""
