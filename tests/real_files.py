"""Real meshes, body scans and patterns of others, in the folder that WARPFLAT_DATA names; without it their tests are skipped."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

__all__ = ["DATA", "needs_data"]

DATA = Path(os.environ.get("WARPFLAT_DATA") or "WARPFLAT_DATA is not set")
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="WARPFLAT_DATA is not set: the folder with the real meshes")
