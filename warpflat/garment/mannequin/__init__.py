"""The mannequin: a body from a size, from measurements or from a scan, and the forms on it."""
