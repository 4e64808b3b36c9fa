"""What a usual run needs is compiled together, on all cores."""

from __future__ import annotations

import pkgutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import warp as wp
import warpflat.kernels
from warpflat.kernels import membrane, springs

from warpflat import compiling
from warpflat.compiling import compile_usual


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[str], int]]:
    """The modules that Warp is asked for, and on how many threads; nothing but `cells` and `membrane` is compiled."""
    calls: list[tuple[list[str], int]] = []

    def force_load(device: wp.Device, modules: Sequence[Any], *, block_dim: int, max_workers: int) -> None:
        assert device.is_cpu
        assert block_dim == 1
        calls.append(([module.name for module in modules], max_workers))

    wp.init()
    monkeypatch.setattr(wp, "force_load", force_load)
    monkeypatch.setattr(compiling, "_is_compiled", lambda module: module.name.endswith((".cells", ".membrane")))
    monkeypatch.setenv("WARPFLAT_THREADS", "2")
    return calls


def test_what_is_missing_is_compiled_together(asked: list[tuple[list[str], int]]):
    compile_usual(springs.compute_spring_energy.module, wp.get_device("cpu"))
    ((names, threads),) = asked
    assert threads == 2
    assert sorted(names) == sorted(f"warpflat.kernels.{name}" for name in compiling._USUAL if name != "cells")
    known = {module.name for module in pkgutil.iter_modules(warpflat.kernels.__path__)}
    assert set(compiling._USUAL) < known


def test_nothing_is_compiled_for_what_is_there_or_seldom_needed_or_by_one_thread(
    asked: list[tuple[list[str], int]], monkeypatch: pytest.MonkeyPatch
):
    compile_usual(membrane.compute_membrane_energy.module, wp.get_device("cpu"))
    monkeypatch.setenv("WARPFLAT_THREADS", "1")
    compile_usual(springs.compute_spring_energy.module, wp.get_device("cpu"))
    monkeypatch.setenv("WARPFLAT_THREADS", "2")
    monkeypatch.setattr(compiling, "_is_compiled", lambda _: True)
    compile_usual(springs.compute_spring_energy.module, wp.get_device("cpu"))
    assert asked == []


def test_compiled_code_is_where_warp_looks_for_it(tmp_path: Path):
    code = f"""
import os, sys
os.environ["WARPFLAT_THREADS"] = "2"
import warp as wp
wp.config.kernel_cache_dir = {str(tmp_path)!r}
import numpy as np
from warpflat import compiling
from warpflat.kernels.sums import subtract
from warpflat.launching import launch_each
compiling._USUAL = ("sums", "springs")
way = np.ones((3, 2))
launch_each(subtract, 3, [np.full((3, 2), 5.0), np.full((3, 2), 3.0)], [way])
sys.exit(int(way[0, 0]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    # Both by the first kernel of one.
    compiled = {module.name.rpartition("_")[0] for module in tmp_path.glob("**/wp_warpflat*") if module.is_dir()}
    assert compiled == {"wp_warpflat.kernels.sums", "wp_warpflat.kernels.springs"}
