"""Too little memory is one line, before a library in C++ crashes for want of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from warpflat.core import memory_limit as memory
from warpflat.core.errors import InputError
from warpflat.core.memory_limit import is_out_of_memory, require_memory_for_run, require_memory_for_usd

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="address space is limited so on Linux alone")

GIGABYTE = 1_000_000_000
PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from warpflat.__main__ import program
sys.exit(program())
"""


def refused(folder: Path, limit: int, *arguments: str) -> str:
    """What the program tells that has so much address space [bytes], exits with 2 and writes nothing."""
    before = sorted(path.name for path in folder.iterdir())
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(limit=limit), *arguments],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert sorted(path.name for path in folder.iterdir()) == before
    return done.stderr


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """A folder with a mesh of 100,000 vertices."""
    side = 317
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel() + 1
    with open(tmp_path / "large.obj", "w", encoding="ascii") as file:
        np.savetxt(file, np.c_[x, y, 0.1 * x * y], fmt="v %.6f %.6f %.6f")
        np.savetxt(file, np.c_[corner, corner + 1, corner + side + 1, corner + side], fmt="f %d %d %d %d")
    return tmp_path


@linux
@pytest.mark.parametrize("gigabytes", [0.3, 0.8, 1.2, 2.0])
def test_a_large_mesh_in_too_little_memory_is_refused(gigabytes: float, large: Path):
    told = refused(large, int(gigabytes * GIGABYTE), "flatten", "large.obj", "--units", "m")
    assert told.startswith("warpflat: not enough memory: ")
    assert f"limit for this process is {1000 * gigabytes:,.0f} MB" in told


@linux
@pytest.mark.parametrize("gigabytes", [0.3, 1.0, 1.2])
def test_a_mannequin_in_too_little_memory_is_refused(gigabytes: float, tmp_path: Path):
    told = refused(tmp_path, int(gigabytes * GIGABYTE), "mannequin", "--size", "EU 38")
    assert told.startswith("warpflat: not enough memory: loading the ")


@linux
def test_a_usd_file_in_too_little_memory_is_refused(tmp_path: Path):
    (tmp_path / "cloth.usda").write_text("#usda 1.0\n")
    told = refused(tmp_path, int(1.0 * GIGABYTE), "flatten", "cloth.usda", "--frames", "0")
    assert told.startswith("warpflat: cloth.usda: not enough memory: loading the USD library")


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
