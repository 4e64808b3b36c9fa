"""The surface of a garment in space: a mesh with feature lines."""
