"""What surrounds the process is checked before a run begins: some of it makes libraries in C++ abort or crash, and no run can end well."""

from __future__ import annotations

import os
import re
from contextlib import suppress

from warpflat.core import InputError, quote_value

__all__ = ["require_environment"]

# Of the stack [bytes]: with half of it the compiler of the kernels runs through, with a quarter it does not.
_STACK = 1 << 20


def require_environment() -> None:
    """Check the variables that libraries read without checking them, and the size of the stack.

    Raises:
        InputError: one is wrong.
    """
    limit = os.environ.get("PXR_WORK_THREAD_LIMIT", "")
    if limit and (re.fullmatch(r"[+-]?[0-9]{1,10}", limit) is None or abs(int(limit)) > 2**31 - 1):
        raise InputError(
            f"PXR_WORK_THREAD_LIMIT = {quote_value(limit)}: it must be a whole number of threads, such as 2; or leave it unset"
        )
    # All pictures are drawn into files, whichever backend shows windows elsewhere.
    os.environ["MPLBACKEND"] = "agg"
    with suppress(ImportError):  # Windows has no such limit
        import resource

        stack = resource.getrlimit(resource.RLIMIT_STACK)[0]
        if stack != resource.RLIM_INFINITY and stack < _STACK:
            wanted = _STACK // 1024
            raise InputError(
                f"the stack is limited to {stack // 1024} kB; {wanted} are needed: ulimit -s {wanted} gives them"
            )
