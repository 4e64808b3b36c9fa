"""Tests run in two processes; each then keeps to one thread, so that they do not wait for each other."""

import os
import signal

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("WARPFLAT_THREADS", "1")
# As the command has it: threads of BLAS that wait for each other on a busy machine take several times the processor's time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell lets what it starts in the background ignore Ctrl-C, and the programs that tests start would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
