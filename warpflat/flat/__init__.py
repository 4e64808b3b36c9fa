"""The paper: from a surface to a flat layout, and its cuts."""
