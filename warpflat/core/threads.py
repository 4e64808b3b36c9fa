"""The number of threads."""

from __future__ import annotations

import os

from warpflat.core.errors import InputError

__all__ = ["core_count", "thread_count"]


def core_count() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count() -> int:
    """Return the number of threads: ``WARPFLAT_THREADS``, or the number of cores that this process may use.

    Raises:
        InputError: the variable is not a whole number of at least 1.
    """
    wished = os.environ.get("WARPFLAT_THREADS", "").strip()
    if not wished:
        return core_count()
    if not wished.isdecimal() or int(wished) < 1:
        raise InputError(f"WARPFLAT_THREADS = {wished!r}; must be a whole number of threads, 1 or more")
    return int(wished)
