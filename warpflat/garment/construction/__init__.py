"""A form becomes pieces that sew up: sewing, ease, fullness, constraints, pattern."""
