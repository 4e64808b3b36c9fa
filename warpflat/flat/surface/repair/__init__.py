"""Meshes are checked and repaired here."""
