"""Approximate implicit steps on one, two, ... threads: microseconds a step, nanoseconds a vertex, and gigabytes a second of what
has to be moved; the least of many.

    python benchmarks/threads.py [--sizes 256 1024 4096 10000 40000 160000] [--threads 1 2] [--devices cuda:0] [--shape bodice]
        [--triangles]

A sweep of four steps is measured, as the relaxation takes them.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import warp as wp
from machine import step_bytes
from numpy.typing import NDArray

from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.flattening.develop import develop
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]

SWEEP = 4
CLOTH = Fabric(name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=375.0, areal_density=0.15)


def sweep_of(network: SpringNetwork, start: FloatArray) -> Callable[[], None]:
    """What takes so many steps, and waits for them."""
    state = Relaxation(network, RelaxOptions(kinetic_damping=False), start=start)

    def sweep() -> None:
        for number in range(SWEEP):
            state.step(check_cells=number == 0)
        wp.synchronize_device(network.device)

    # Launches are recorded when they are first used, for so many threads as are wished for then.
    sweep()
    return sweep


def measure(shape: str, size: int, threads: list[int], devices: list[str], triangles: bool, seconds: float) -> None:
    """Print the line of one size."""
    surface = make_shape(shape, resolution=max(5, round(size**0.5)), triangles=triangles)
    start = develop(surface, surface.lines["centre"]).positions
    build = partial(SpringNetwork.build, surface, CLOTH, start)
    network, steps = build(device="cpu"), dict[str, Callable[[], None]]()
    for count in threads:
        os.environ["WARPFLAT_THREADS"] = str(count)
        steps[f"{count} thr."] = sweep_of(network, start)
    for device in devices:
        steps[device] = sweep_of(build(device=device), start)
    least = dict.fromkeys(steps, float("inf"))
    until = time.perf_counter() + seconds
    # In turns, so that whatever else the machine does falls on all of them alike.
    while time.perf_counter() < until:
        for name, step in steps.items():
            begun = time.perf_counter()
            step()
            least[name] = min(least[name], (time.perf_counter() - begun) / SWEEP)
    count = network.vertex_count
    moved = step_bytes(network)
    texts = [
        f"{name} {1e6 * value:9.1f} us {1e9 * value / count:6.1f} ns {1e-9 * moved / value:7.1f} GB/s"
        for name, value in least.items()
    ]
    print(f"{count:9,d}  " + "   ".join(texts), flush=True)


def main() -> None:
    """Measure each size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 1_024, 4_096, 10_000, 40_000, 160_000])
    parser.add_argument("--threads", type=int, nargs="+", default=list(range(1, (os.cpu_count() or 1) + 1)))
    parser.add_argument("--devices", nargs="*", default=[], help="of Warp, beside the CPU, such as cuda:0")
    parser.add_argument("--shape", default="bodice")
    parser.add_argument("--triangles", action="store_true")
    parser.add_argument("--seconds", type=float, default=5.0, help="spent on each size")
    chosen = parser.parse_args()
    wp.config.quiet = True
    for size in chosen.sizes:
        measure(chosen.shape, size, chosen.threads, chosen.devices, chosen.triangles, chosen.seconds)


if __name__ == "__main__":
    main()
