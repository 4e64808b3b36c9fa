"""A surface is cut along lines here."""
