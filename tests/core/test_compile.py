"""What a usual run needs is compiled together, on all cores."""

from __future__ import annotations

import errno
import os
import pkgutil
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import warp as wp
import warpflat.kernels
from command import Ended
from fuzz.snapshot import snapshot
from warpflat.kernels import membrane, springs

from warpflat.core import compile as compiling
from warpflat.core.compile import compile_common_modules
from warpflat.core.errors import InputError


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], int]]:
    """The modules that Warp is asked for, and on how many threads; only `membrane` is compiled yet."""
    calls: list[tuple[list[str], int]] = []

    def force_load(device: wp.Device, modules: Sequence[Any], *, max_workers: int) -> None:
        assert device.is_cpu
        calls.append(([module.name for module in modules], max_workers))

    wp.init()
    monkeypatch.setattr(wp, "force_load", force_load)
    monkeypatch.setattr(compiling, "_is_compiled", lambda module: module.name.endswith(".membrane"))
    monkeypatch.setenv("WARPFLAT_THREADS", "2")
    return calls


def test_what_a_usual_run_needs_is_compiled_together(asked: list[tuple[list[str], int]]):
    compile_common_modules(springs.compute_spring_energy.module, wp.get_device("cpu"))
    ((names, threads),) = asked
    assert threads == 2
    assert sorted(names) == sorted(f"warpflat.kernels.{name}" for name in compiling._COMMON_MODULES)
    known = {module.name for module in pkgutil.iter_modules(warpflat.kernels.__path__)}
    assert set(compiling._COMMON_MODULES) < known


def test_nothing_is_compiled_for_what_is_there_or_seldom_needed_or_by_one_thread(
    asked: list[tuple[list[str], int]], monkeypatch: pytest.MonkeyPatch
):
    compile_common_modules(membrane.compute_membrane_energy.module, wp.get_device("cpu"))
    monkeypatch.setenv("WARPFLAT_THREADS", "1")
    compile_common_modules(springs.compute_spring_energy.module, wp.get_device("cpu"))
    monkeypatch.setenv("WARPFLAT_THREADS", "2")
    monkeypatch.setattr(compiling, "_is_compiled", lambda _: True)
    compile_common_modules(springs.compute_spring_energy.module, wp.get_device("cpu"))
    assert asked == []


def test_a_kernel_cache_that_is_full_is_named(asked: list[tuple[list[str], int]], monkeypatch: pytest.MonkeyPatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(wp, "force_load", full)
    with pytest.raises(
        InputError, match=r"^kernel cache /.* cannot be written: no space left on device; set WARP_CACHE_PATH"
    ):
        compile_common_modules(springs.compute_spring_energy.module, wp.get_device("cpu"))
    assert asked == []


def flattened(folder: Path, *, limit: int | None = None, **environment: str) -> Ended:
    """How the program ends that flattens a square, and what it changes outside the folder `cache`.

    Args:
        folder: empty.
        limit: of every file that is written [bytes].
        environment: variables of the process.
    """
    (folder / "cloth.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    before = snapshot(folder)
    code = "import sys; from warpflat.__main__ import program; sys.exit(program())"
    if limit is not None:
        code = f"import resource as r; r.setrlimit(r.RLIMIT_FSIZE, ({limit}, {limit}))\n{code}"
    done = subprocess.run(
        [sys.executable, "-c", code, "flatten", "cloth.obj", "--units", "m"],
        cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    after = snapshot(folder)
    changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    return Ended(
        done.returncode, done.stdout, done.stderr, frozenset(name for name in changed if not name.startswith("cache"))
    )


@pytest.mark.skipif(os.name != "posix", reason="only POSIX has /dev/null and limits of files")
def test_a_kernel_cache_that_cannot_be_made_is_one_line(tmp_path: Path):
    told = flattened(tmp_path, WARP_CACHE_PATH="/dev/null/x").refusal
    assert re.match(r"kernel cache /dev/null/x/\S+ cannot be written: not a directory; set WARP_CACHE_PATH", told)


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="elsewhere the cache is not in the home folder's .cache"
)
def test_a_home_that_is_no_folder_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name in ("WARP_CACHE_PATH", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    told = flattened(tmp_path, HOME="/dev/null").refusal
    assert told.startswith("kernel cache /dev/null/.cache/warp/")


@pytest.mark.skipif(os.name != "posix", reason="only POSIX has limits of files")
@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_kernel_cache_without_room_is_one_line(threads: str, tmp_path: Path):
    cache = str(tmp_path / "cache")
    told = flattened(tmp_path, limit=20_000, WARP_CACHE_PATH=cache, WARPFLAT_THREADS=threads).refusal
    assert f"kernel cache {cache}" in told
    assert "cannot be written: file too large" in told


def test_compiled_code_is_where_warp_looks_for_it(tmp_path: Path):
    code = f"""
import os, sys
os.environ["WARPFLAT_THREADS"] = "2"
import warp as wp
wp.config.kernel_cache_dir = {str(tmp_path)!r}
import numpy as np
from warpflat.core import compile as compiling
from warpflat.kernels.reduce import subtract
from warpflat.core.launch import launch_each
compiling._COMMON_MODULES = ("reduce", "closest")
way = np.ones((3, 2))
launch_each(subtract, 3, [np.full((3, 2), 5.0), np.full((3, 2), 3.0)], [way])
sys.exit(int(way[0, 0]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    # Both by the first kernel of one.
    compiled = {module.name.rpartition("_")[0] for module in tmp_path.glob("**/wp_warpflat*") if module.is_dir()}
    assert compiled == {"wp_warpflat.kernels.reduce", "wp_warpflat.kernels.closest"}
