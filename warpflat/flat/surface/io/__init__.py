"""Mesh files are read here."""
