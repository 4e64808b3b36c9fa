"""The ``warpflat`` program, also as ``python -m warpflat``: the command line in a process of its own."""

from __future__ import annotations

import gc
import os
import sys

from warpflat.cli.signals import end_at_once, ignore_at_exit

__all__ = ["program"]

# Objects made before unreachable ones are looked for, and rounds of that before it is among all that have grown old. Importing alone
# makes a million that stay: with Python's own numbers that search is a sixth of a run.
_SELDOM = 50_000, 20, 100


def program() -> int:
    """Run the command line on the arguments of this process, and return its exit code."""
    end_at_once()  # before anything is imported that takes a while
    ignore_at_exit()  # before anything else asks for something at exit: the first is done last
    gc.set_threshold(*_SELDOM)
    # Dense matrices have some hundred rows. A second thread of OpenBLAS gains nothing there, and while other processes run it waits for a
    # core: a fifth of the processor time of a block.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _silence_libraries()
    from warpflat.cli.main import main

    code: int | None = None
    try:
        code = main()
        return code
    finally:
        end_at_once(code)
        # All files are closed; to look for what is unreachable once more before the process ends takes half a second.
        gc.freeze()


def _silence_libraries() -> None:
    """Keep warnings and logs of libraries off standard error: they are for programmers, and a mistake is one line."""
    import logging
    import warnings

    if not sys.warnoptions:  # python -W and PYTHONWARNINGS ask for them
        warnings.simplefilter("ignore")
    logging.getLogger().addHandler(logging.NullHandler())


if __name__ == "__main__":
    sys.exit(program())
