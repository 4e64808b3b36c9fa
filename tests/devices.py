"""Where tests run kernels: on the CPU, or on the Warp device that ``WARPFLAT_TEST_DEVICE`` names, such as ``cuda:0``."""

import os

__all__ = ["DEVICE"]

DEVICE = os.environ.get("WARPFLAT_TEST_DEVICE", "cpu")
