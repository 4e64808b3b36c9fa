"""A flat piece becomes a pattern here: sewing lines, allowances, notches, labels, marker."""
