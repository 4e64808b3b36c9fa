"""How far a finer mesh moves the outline of a pattern: surfaces by formula, refined again and again.

    python benchmarks/refinement.py [--shape bodice] [--shear 20] [--cells quads] [--resolutions 33 65 129 257]

The farthest that a border point of the coarser pattern lies from its place in the next finer one, laid on each other [mm], for a cloth of
1000 N/m in warp and weft. All of the table without options (half an hour); `!` marks a run that did not converge or has mirrored faces.
"""

from __future__ import annotations

import argparse
import time
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpflat import Fabric, flatten
from warpflat.core.vectors import laid_upon
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]


def outline(piece: Flattening, resolution: int) -> FloatArray:
    """Border of a grid, once round [m]."""
    i = np.arange(resolution**2).reshape(resolution, resolution)
    return piece.positions[np.concatenate([i[0, :-1], i[:-1, -1], i[-1, :0:-1], i[:0:-1, 0]])]


def moved(coarse: FloatArray, fine: FloatArray) -> float:
    """Farthest that a border point of the coarse pattern lies from its place in the fine one, laid on each other [m]."""
    fine = fine[:: len(fine) // len(coarse)]
    return float(np.linalg.norm(laid_upon(coarse, fine) - coarse, axis=1).max())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shape", nargs="+", default=["dome", "saddle", "bodice"])
    parser.add_argument("--shear", nargs="+", type=float, default=[200.0, 20.0], help="G [N/m]")
    parser.add_argument("--cells", nargs="+", choices=["quads", "triangles"], default=["quads", "triangles"])
    parser.add_argument("--resolutions", nargs="+", type=int, default=[33, 65, 129, 257])
    parser.add_argument("--model", default="auto", choices=["auto", "springs", "membrane"])
    parser.add_argument("--residual", type=float, default=1e-4, help="where relaxations stop")
    arguments = parser.parse_args()
    steps = [f"{a}>{b}" for a, b in pairwise(arguments.resolutions)]
    print(f"{'':30}" + "".join(f"{s:>12}" for s in steps) + f"{'first>last':>12}   steps, seconds")
    for shape in arguments.shape:
        for cells in arguments.cells:
            for shear in arguments.shear:
                row(shape, cells, shear, arguments)


def row(shape: str, cells: str, shear: float, arguments: argparse.Namespace) -> None:
    """One line of the table."""
    cloth = Fabric(
        name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=shear, areal_density=0.15
    )
    outlines, spent, fine = [], [], True
    for resolution in arguments.resolutions:
        begun = time.perf_counter()
        piece = flatten(
            make_shape(shape, resolution=resolution, triangles=cells == "triangles"),
            fabric=cloth,
            datum="centre",
            model=arguments.model,
            relax=RelaxOptions(residual_tolerance=arguments.residual, max_steps=100_000),
        )
        fine = fine and piece.converged and not piece.flipped_faces
        spent.append(f"{piece.stages[-1].steps} {time.perf_counter() - begun:.1f} s")
        outlines.append(outline(piece, resolution))
    moves = [moved(a, b) for a, b in [*pairwise(outlines), (outlines[0], outlines[-1])]]
    name = f"{shape}, {cells}, G/K = {shear / 1000:g}{'' if fine else ' !'}"
    print(f"{name:30}" + "".join(f"{1e3 * m:12.3f}" for m in moves) + "   " + "; ".join(spent), flush=True)


if __name__ == "__main__":
    main()
