"""Ten sizes of a piece, one after the other and all at once.

    OMP_NUM_THREADS=1 python benchmarks/batches.py [--sizes 600 2500 10000] [--shapes dome bodice] [--fabric woven] [--triangles]

Seconds of `warpflat.flatten` ten times and of `warpflat.flatten_all` once, in turns, the fastest of several; and the largest
difference of an energy.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import warp as wp

import warpflat
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.shapes import make_shape


def sizes_of(shape: str, vertices: int, triangles: bool) -> list[Surface]:
    """Ten of them, from nine tenths of the size to eleven tenths."""
    whole = make_shape(shape, resolution=round(vertices**0.5) | 1, triangles=triangles)
    made = []
    for number in range(10):
        scale = 0.9 + 0.2 * number / 9
        made.append(
            replace(
                whole,
                vertices=scale * whole.vertices,
                input_vertices=scale * whole.input_vertices,
                name=f"{shape} {number}",
            )
        )
    return made


def energy(piece: Flattening) -> float:
    """Return the model energy of a piece at its end [J]."""
    last = piece.stages[-1]
    return last.model_energy_j


def main() -> None:
    """Measure each shape and size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[600, 2_500, 10_000], metavar="VERTICES")
    parser.add_argument("--shapes", nargs="+", choices=["dome", "bodice"], default=["dome", "bodice"])
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--triangles", action="store_true")
    parser.add_argument("--device", default="cpu", help="of Warp, such as cuda:0")
    parser.add_argument("--repeats", type=int, default=3)
    chosen = parser.parse_args()
    wp.config.quiet = True
    given = {"fabric": chosen.fabric, "datum": "centre", "device": chosen.device}
    warpflat.flatten_all(sizes_of("dome", 200, chosen.triangles), **given)
    for size in chosen.sizes:
        for shape in chosen.shapes:
            best = [float("inf"), float("inf")]
            for _ in range(chosen.repeats):
                surfaces = sizes_of(shape, size, chosen.triangles)
                begun = time.perf_counter()
                apart = [warpflat.flatten(surface, **given) for surface in surfaces]
                between = time.perf_counter()
                together = warpflat.flatten_all(sizes_of(shape, size, chosen.triangles), **given)
                best = [min(best[0], between - begun), min(best[1], time.perf_counter() - between)]
            off = max(abs(energy(a) / energy(b) - 1.0) for a, b in zip(together, apart, strict=True))
            print(
                f"ten {shape}s of {len(surfaces[0].vertices):,} vertices: {best[0]:.3f} s one after the other, {best[1]:.3f} s at once, "
                f"{best[0] / best[1]:.2f}x; energies within {off:.0e}; flips {sum(p.flipped_faces for p in together)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
