"""Memory limits are checked before a run begins, since libraries in C++ crash where they get no memory."""

from __future__ import annotations

import mmap
import os
import sys
from contextlib import suppress

from warpflat.core.errors import InputError
from warpflat.core.threads import core_count

__all__ = [
    "is_out_of_memory",
    "memory_limit",
    "require_memory_for_libraries",
    "require_memory_for_run",
    "require_memory_for_usd",
]

# Address space [MB], measured on Linux: it is what a process may be limited to, and more than the memory that is written to.
_LIBRARIES, _OPENBLAS_THREAD = 580, 90
_RUN, _VERTEX = 200, 4e-3
_USD, _USD_THREAD = 850, 140

# What libraries say of it, in lower case, where they raise anything but a MemoryError.
_SAID = (
    "allocate memory",
    "failed to allocate",
    "failed to map segment",
    "can't start new thread",
    "bad_alloc",
    "out of memory",
)


def require_memory_for_libraries() -> None:
    """Check that there is memory for the libraries of a run.

    Raises:
        InputError: they cannot.
    """
    given = [os.environ.get(name, "") for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")]
    threads = min([core_count(), *(max(int(number), 1) for number in given if number.isdecimal())])
    _require(_LIBRARIES + _OPENBLAS_THREAD * threads, "loading the libraries", "")


def require_memory_for_run(vertices: int, *, frames: bool) -> None:
    """Check that there is memory to flatten a mesh and to write its frames.

    Raises:
        InputError: it cannot.
    """
    usd = 0 if not frames or "pxr.Usd" in sys.modules else _usd()
    remedy = ", or leave the film out with frames = 0" if frames else ""
    _require(_RUN + usd + _VERTEX * vertices, f"flattening {vertices:,} vertices", remedy)


def require_memory_for_usd() -> None:
    """Check that there is memory for the USD library.

    Raises:
        InputError: it cannot.
    """
    if "pxr.Usd" not in sys.modules:
        _require(_usd(), "loading the USD library", "")


def is_out_of_memory(error: BaseException | None) -> bool:
    """Return whether an error, or one that caused it, says that there was no memory."""
    seen = set[int]()
    while error is not None and id(error) not in seen:
        if isinstance(error, MemoryError) or any(words in str(error).lower() for words in _SAID):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def memory_limit() -> str:
    """Return the limit on the address space of this process as text; empty if there is none."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            return f"the limit for this process is {limit / 1e6:,.0f} MB (ulimit -v {limit // 1024})"
    return ""


def _require(megabytes: float, what: str, remedy: str) -> None:
    try:
        # No page is touched, so this takes no memory and no time.
        mmap.mmap(-1, int(megabytes * 1e6)).close()
    except OSError:
        limit = memory_limit()
        note = f", and {limit}" if limit else ""
        raise InputError(
            f"not enough memory: {what} takes {megabytes:,.0f} MB more{note}; raise the limit{remedy}"
        ) from None


def _usd() -> float:
    threads = os.environ.get("PXR_WORK_THREAD_LIMIT", "")
    return _USD + _USD_THREAD * (int(threads) if threads.isdecimal() and int(threads) > 0 else core_count())
