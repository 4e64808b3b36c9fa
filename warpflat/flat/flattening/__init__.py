"""A surface is flattened here: datum line, development, relaxation, result."""
