"""Many scenes in one command: bodies, fabrics and overrides, in this process or on Dask workers."""
