"""The sewn garment on the body in space: it is draped, measured and drawn."""
