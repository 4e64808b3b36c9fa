"""Fabrics: stiffness, its measurement, and the library."""
