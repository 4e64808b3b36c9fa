"""The mechanical model of a piece: springs, membrane, strain energy, fit and constraints."""
