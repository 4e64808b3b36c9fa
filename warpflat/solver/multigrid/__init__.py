"""The multigrid solver: a hierarchy of coarser levels and cycles through them."""
