"""What is freed goes back to the system, where the C library can."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from warpflat.core import free_memory as heap

STATUS = Path("/proc/self/statm")


@pytest.mark.skipif(heap._trim() is None, reason="no glibc")
def test_what_is_freed_goes_back() -> None:
    pages = [np.ones(4_000) for _ in range(4_000)]  # 128 MB in pieces too small to be mapped one by one
    keep = [*pages[:: len(pages) // 20], pages[-1]]
    before = int(STATUS.read_text().split()[1])
    del pages
    heap.return_freed_memory()
    after = int(STATUS.read_text().split()[1])
    assert all(page.all() for page in keep)
    assert (before - after) * 4096 > 80e6


def test_elsewhere_nothing_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    heap._trim.cache_clear()
    try:
        assert heap._trim() is None
        heap.return_freed_memory()
    finally:
        heap._trim.cache_clear()
