"""The ``warpflat`` program, also as ``python -m warpflat``: the command line in a process of its own."""

from __future__ import annotations

import gc
import sys

from warpflat.cli import main

__all__ = ["program"]

# Objects made before unreachable ones are looked for, and rounds of that before it is among all that have grown old. Importing alone
# makes a million that stay: with Python's own numbers that search is a sixth of a run.
_SELDOM = 50_000, 20, 100


def program() -> int:
    """Run the command line on the arguments of this process, and return its exit code."""
    gc.set_threshold(*_SELDOM)
    try:
        return main()
    finally:
        # All files are closed; to look for what is unreachable once more before the process ends takes half a second.
        gc.freeze()


if __name__ == "__main__":
    sys.exit(program())
