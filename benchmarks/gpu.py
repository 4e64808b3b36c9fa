"""The same work on the CPU and on a GPU: kernels' tests, then seconds and energies of pieces, blocks, seams and a drape.

    python benchmarks/gpu.py [--device cuda:0] [--sizes 40000 160000 1000000] [--blocks 1 32 256] [--skip-tests] [--json FILE]

Every figure is the second of two runs, in wall-clock seconds, since the first one compiles. A difference of energies is relative to the
CPU's; above 1e-4 it ends with 1. Of a drape it is the mean distance to the designed surface [m]. `block` is the basic block of EU 38:
flattened and sewn, so many times; then one of them is draped. What no kernel does stays on the host on any device: reading, development,
the factor and its solutions (SciPy), topology, drafting and files.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import warp as wp
from meshes import KINDS

import warpflat
from warpflat.core.compile import start_warp

TOLERANCE = 1e-4


def second_of_two(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of the second of two runs, and its result."""
    work()
    begun = time.perf_counter()
    result = work()
    wp.synchronize()
    return time.perf_counter() - begun, result


def jobs(sizes: list[int], blocks: list[int]) -> Iterator[tuple[str, Callable[[str], tuple[Any, float]]]]:
    """Each job's name, and what does it on a device and returns its result and its energy [J]."""
    for kind in ("grid", "irregular"):
        for size in sizes:
            mesh = KINDS[kind]("bodice", size)

            def flatten(device: str, mesh: Any = mesh) -> tuple[Any, float]:
                # As if read anew: what was computed for a surface is not computed again.
                surface = replace(mesh.surface, faces=mesh.surface.faces.copy())
                piece = warpflat.flatten(surface, fabric="woven", datum=mesh.datum, device=device)
                return piece, piece.stages[-1].model_energy_j

            yield f"flatten {kind} {len(mesh.surface.vertices):,}", flatten
    body = warpflat.Mannequin.from_size("EU 38", resolution_mm=10.0)
    form = body.form("basic_block")

    def block(device: str, count: int) -> tuple[Any, float]:
        for _ in range(count):
            garment = warpflat.flatten_form(body, form, fabric="woven", device=device)
        return garment, sum(piece.stages[-1].model_energy_j for piece in garment.pieces.values())

    for count in blocks:
        yield f"block, sewn, x {count}", lambda device, count=count: block(device, count)

    def drape(device: str) -> tuple[Any, float]:
        draped = warpflat.drape(block("cpu", 1)[0], device=device)
        # A minimum of pose has no one energy in its measures: the distance to the designed surface is compared.
        return draped, draped.measures()["distance_m"]["mean"]

    yield "block, draped: mean distance", drape


def main() -> int:
    """Run the tests, then the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0", help="of Warp, beside the CPU")
    parser.add_argument("--sizes", type=int, nargs="*", default=[40_000, 160_000, 1_000_000])
    parser.add_argument("--blocks", type=int, nargs="*", default=[1, 32, 256])
    parser.add_argument("--skip-tests", action="store_true")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    start_warp()
    if chosen.device not in [str(device) for device in wp.get_devices()]:
        print(f"no device {chosen.device!r} here; there are {', '.join(map(str, wp.get_devices()))}", file=sys.stderr)
        return 2
    root = Path(__file__).resolve().parent.parent
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True)
    print(f"{wp.get_device(chosen.device).name}, Warp {wp.__version__}, commit {commit.stdout.strip() or 'unknown'}")
    failed = 0
    if not chosen.skip_tests:
        environment = os.environ | {"WARPFLAT_TEST_DEVICE": chosen.device}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:xdist", "tests/kernels", "tests/solver"]
        failed = subprocess.run(command, cwd=root, env=environment).returncode
    rows = []
    print(f"{'':28} {'CPU [s]':>9} {'device [s]':>11} {'ratio':>6} {'energy [J]':>12} {'apart':>8}")
    for name, job in jobs(chosen.sizes, chosen.blocks):
        (on_cpu, (_, energy)), (on_device, (_, other)) = (
            second_of_two(partial(job, device)) for device in ("cpu", chosen.device)
        )
        apart = abs(other / energy - 1.0)
        failed |= apart > TOLERANCE
        print(
            f"{name:28} {on_cpu:9.2f} {on_device:11.2f} {on_cpu / on_device:6.2f} {energy:12.6g} {apart:8.1e}",
            flush=True,
        )
        rows.append({"job": name, "cpu_s": on_cpu, "device_s": on_device, "energy_j": energy, "apart": apart})
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1) + "\n")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
