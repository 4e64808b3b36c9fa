"""Tests run in two processes; each then keeps to one thread, so that they do not wait for each other."""

import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

# As the command has it: threads of BLAS that wait for each other on a busy machine take several times the processor's time.
# Before NumPy is loaded, which reads it once.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("WARPFLAT_THREADS", "1")

import pytest
from command import Command, command_in
from rounding import disturb

from warpflat.core.errors import InputError
from warpflat.core.usd_process import UNREADABLE

# As the program has it: libraries make a million objects that stay, and Python's own numbers search them time and again.
gc.set_threshold(50_000, 20, 100)
# Processes that tests start would each compile the package anew, for a second or two, if none kept what it has compiled.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell lets what it starts in the background ignore Ctrl-C, and the programs that tests start would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option of rounding noise."""
    parser.addoption("--rounding", type=int, metavar="SEED", help="round as another processor might, see rounding.py")


def pytest_configure(config: pytest.Config) -> None:
    """Disturb what is computed, if asked for."""
    if (seed := config.getoption("rounding")) is not None:
        disturb(seed)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the bodies that the processes of a run have shared."""
    if (run := getattr(config.pluginmanager.get_plugin("dsession"), "nodemanager", None)) is not None:
        shutil.rmtree(Path(tempfile.gettempdir()) / f"warpflat-tests-{run.testrunuid}", ignore_errors=True)


@pytest.fixture(autouse=True, scope="module")
def _others_work_once(request: pytest.FixtureRequest) -> Iterator[None]:
    """What is no claim of a test is had sooner.

    A body of a size is built once in a process, and a scan fitted once in a run; sheets and cloth are laid in one order of the pieces
    instead of eight; and the rooms that read and write most USD read it in this process, all others, and the command's own processes,
    in one of its own.
    """
    from bodies import built_once, laid_once, stood

    from warpflat.pattern.drafting.tile_nesting import orders

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("warpflat.garment.mannequin.read_body.stand_body", stood)
        if request.path.parent.name != "mannequin":
            patch.setattr("warpflat.garment.mannequin.mannequin.Mannequin.from_size", built_once)
            patch.setattr("warpflat.garment.mannequin.common_body.CommonBody.of_mannequin", laid_once)
        if request.path.name not in ("test_tile_nesting.py", "test_pattern_marker.py", "test_matched_lay.py"):
            patch.setattr("warpflat.pattern.drafting.tile_nesting.orders", lambda masks: orders(masks)[:1])
        # What has crashed OpenUSD once is not read in this process.
        if (
            request.path.parent.name in ("surface", "export", "review")
            and request.path.name != "test_regression_meshes.py"
        ):
            patch.setattr("warpflat.flat.surface.io.read.read_apart", _read_here)
            patch.setattr("warpflat.app.review.film.read_apart", _read_here)
        yield


def _read_here(function: str, path: Path, **arguments: Any) -> Any:
    """In place of `read_apart`."""
    with path.open("rb"):
        pass
    module, _, name = function.partition(":")
    try:
        return getattr(import_module(module), name)(path.absolute(), **arguments)
    except InputError:
        raise
    except Exception:
        raise InputError(UNREADABLE) from None


@pytest.fixture(scope="session")
def dress() -> Any:
    """The sample dress, drafted in two sizes; nobody changes it."""
    from sample_dress import sample_dress

    from warpflat.pattern.drafting.draft import draft_garment

    return draft_garment(sample_dress(("36", "38")))


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Runs the command line in an empty folder, which becomes the current one."""
    monkeypatch.chdir(tmp_path)
    return command_in(tmp_path, capfd)
