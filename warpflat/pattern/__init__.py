"""Flat pieces on paper: drafting, drawings and files of patterns."""
