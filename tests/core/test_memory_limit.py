"""Too little memory is one line, before a library in C++ crashes for want of it."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.core.memory_limit import is_out_of_memory, require_memory_for_run, require_memory_for_usd

# At the door of `core` stands the function of this name.
memory = import_module("warpflat.core.memory_limit")

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="address space is limited so on Linux alone")

GIGABYTE = 1_000_000_000
PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from warpflat.__main__ import program
sys.exit(program())
"""


def ended(folder: Path, limit: int, *arguments: str) -> tuple[int, str, str, list[str]]:
    """Exit code, standard output and error of the program with so much address space [bytes], and what it left in the folder."""
    before = {path.name for path in folder.iterdir()}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(limit=limit), *arguments],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    left = sorted({path.name for path in folder.iterdir()} - before)
    return done.returncode, done.stdout, done.stderr, left


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a mesh of 100,000 vertices."""
    folder, side = tmp_path_factory.mktemp("large"), 317
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel() + 1
    with open(folder / "large.obj", "w", encoding="ascii") as file:
        np.savetxt(file, np.c_[x, y, 0.1 * x * y], fmt="v %.6f %.6f %.6f")
        np.savetxt(file, np.c_[corner, corner + 1, corner + side + 1, corner + side], fmt="f %d %d %d %d")
    return folder


@linux
@pytest.mark.parametrize(
    ("gigabytes", "arguments", "words"),
    [
        (0.3, "flatten large.obj --units m", "not enough memory: "),
        (2.0, "flatten large.obj --units m", "not enough memory: "),
        (1.2, "mannequin --resolution 40", "not enough memory: loading the "),
        (1.0, "flatten cloth.usda --frames 0", "cloth.usda: not enough memory: loading the USD library"),
    ],
)
def test_what_takes_more_memory_than_there_is_is_refused(gigabytes: float, arguments: str, words: str, large: Path):
    (large / "cloth.usda").write_text("#usda 1.0\n")
    size = ["--size", "EU 38"] if arguments.startswith("mannequin") else []
    code, out, told, left = ended(large, int(gigabytes * GIGABYTE), *arguments.split(), *size)
    assert (code, out, told.count("\n"), left) == (2, "", 1, [])
    assert told.startswith(f"warpflat: {words}")
    assert "large" not in arguments or f"limit for this process is {1000 * gigabytes:,.0f} MB" in told


def test_more_memory_than_any_process_can_have_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(sys.modules, "pxr.Usd", raising=False)
    require_memory_for_run(100, frames=True)
    require_memory_for_usd()
    with pytest.raises(InputError, match=r"flattening 100,000,000,000,000 vertices .*frames = 0"):
        require_memory_for_run(10**14, frames=True)
    monkeypatch.setattr(memory, "_USD", 1e12)
    require_memory_for_run(100, frames=False)
    with pytest.raises(InputError, match="loading the USD library"):
        require_memory_for_usd()


def test_what_says_that_memory_is_refused_is_known():
    assert is_out_of_memory(MemoryError())
    assert is_out_of_memory(RuntimeError("Failed to allocate 9586176 bytes on device 'cpu'"))
    assert is_out_of_memory(RuntimeError("can't start new thread"))
    assert is_out_of_memory(ImportError("libscipy_openblas.so: failed to map segment from shared object"))
    assert not is_out_of_memory(RuntimeError("a bug"))
    loading = RuntimeError("Failed to load the shared library")
    loading.__cause__ = OSError("warp.so: cannot allocate memory in static TLS block")
    assert is_out_of_memory(loading)
