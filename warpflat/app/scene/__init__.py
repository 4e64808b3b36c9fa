"""Scene files: their schema, loading, running and comparing."""
