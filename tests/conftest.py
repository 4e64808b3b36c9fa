"""Tests run in two processes; each then keeps to one thread, so that they do not wait for each other."""

import os

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("WARPFLAT_THREADS", "1")
