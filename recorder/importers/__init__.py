"""Importers that turn foreign files into sessions."""
