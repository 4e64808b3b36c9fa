"""The ``warpflat`` program, also as ``python -m warpflat``: the command line in a process of its own."""

from __future__ import annotations

import gc
import os
import sys

from warpflat.app.cli.internal_error import report_internal_error
from warpflat.app.cli.signals import end_at_once, ignore_at_exit

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
    # USD prints a banner for each of its settings in the environment, in every process that loads it.
    os.environ.setdefault("TF_ENV_SETTING_ALERTS_ENABLED", "0")
    import logging
    import warnings

    # Warnings and logs of libraries are for programmers, and a mistake is one line.
    if not sys.warnoptions:  # python -W and PYTHONWARNINGS ask for them
        warnings.simplefilter("ignore")
    logging.getLogger().addHandler(logging.NullHandler())
    code: int | None = None
    try:
        from warpflat.app.cli.main import main

        code = main()
    except Exception as error:
        # While the commands are imported; `main` itself lets nothing through.
        code = report_internal_error(error, sys.argv[1:])
    finally:
        end_at_once(code)
        # All files are closed; to look for what is unreachable once more before the process ends takes half a second.
        gc.freeze()
    return code


if __name__ == "__main__":
    sys.exit(program())
