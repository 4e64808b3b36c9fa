"""What a run takes besides relaxing: measures, files, frames, picture and pattern, and the start of the program.

    OMP_NUM_THREADS=1 python benchmarks/writing.py [--sizes 2500 40000] [--shapes dome bodice] [--kinds grid irregular] [--start]

Milliseconds, the fastest of several. `metrics, OBJ` is `Flattening.save` without picture and frames; these are what each adds to that;
`pattern` is drafting and writing DXF, SVG, PDF and JSON. `--start` runs the first scene as a process of its own, with an empty
cache of kernels and with a filled one.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import warp as wp
from meshes import KINDS, Mesh
from speed import CLOTH

import warpflat
from warpflat.flat.flattening.result import Flattening
from warpflat.garment.construction.garment_files import surface_files

SCENE = Path(__file__).parents[1] / "scenes" / "dome.toml"


def seconds_of(run: Callable[[], object]) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def measure(mesh: Mesh, repeats: int) -> dict[str, float]:
    """The fastest of several [s]; each time of a surface and a result that nothing is known of."""
    best: dict[str, float] = {}

    def note(name: str, seconds: float) -> None:
        best[name] = min(best.get(name, seconds), seconds)

    def flat() -> Flattening:
        surface = replace(mesh.surface, faces=mesh.surface.faces.copy())
        begun = time.perf_counter()
        result = warpflat.flatten(surface, fabric=CLOTH, datum=mesh.datum, device="cpu")
        note("flatten", time.perf_counter() - begun)
        return result

    for _ in range(repeats):
        for name, picture, frames in (("files", False, False), ("frames", False, True), ("picture", True, False)):
            result = flat()
            with tempfile.TemporaryDirectory() as folder:
                note(name, seconds_of(partial(result.save, folder, picture=picture, frames=frames)))
        result = flat()
        with tempfile.TemporaryDirectory() as folder:
            note("pattern", seconds_of(partial(surface_files, [result], folder, name="piece")))
    return {
        "flatten": best["flatten"],
        "metrics, OBJ": best["files"],
        "frames": best["frames"] - best["files"],
        "picture": best["picture"] - best["files"],
        "pattern": best["pattern"],
    }


def start(repeats: int) -> None:
    """Print how long the program takes for its first scene."""
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for number in range(repeats + 1):
            command = [sys.executable, "-m", "warpflat", "run", str(SCENE), "--out", f"{folder}/out{number}", "--quiet"]
            cache = {"WARP_CACHE_PATH": f"{folder}/kernels"}
            times.append(seconds_of(partial(subprocess.run, command, check=True, env=os.environ | cache)))
    print(
        f"warpflat run scenes/{SCENE.name}: {times[0]:.2f} s with an empty cache of kernels, {min(times[1:]):.2f} s with a filled one"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="What a run takes besides relaxing.")
    parser.add_argument("--sizes", type=int, nargs="+", default=[2_500, 40_000], metavar="VERTICES")
    parser.add_argument("--shapes", nargs="+", choices=["dome", "bodice"], default=["dome", "bodice"])
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=["grid", "irregular"])
    parser.add_argument("--repeats", type=int, default=3, help="the fastest counts")
    parser.add_argument("--start", action="store_true", help="the program's start, too")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    for size in chosen.sizes:
        for kind in chosen.kinds:
            for shape in chosen.shapes:
                mesh = KINDS[kind](shape, size)
                measure(mesh, 1)
                found = measure(mesh, chosen.repeats)
                told = ", ".join(f"{name} {1e3 * seconds:.0f}" for name, seconds in found.items())
                print(f"{shape}, {kind}, {len(mesh.surface.vertices):,} vertices [ms]: {told}", flush=True)
    if chosen.start:
        start(chosen.repeats)


if __name__ == "__main__":
    main()
