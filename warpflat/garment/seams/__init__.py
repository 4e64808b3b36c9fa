"""Seams of a whole garment: what it is, where a tailor would cut it, and the pieces that this leaves."""
