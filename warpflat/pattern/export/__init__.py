"""Files of patterns, surfaces and pictures are written here."""
