"""Garments: bodies and forms, sewing, finishing, seams that are found, draping."""
