"""Processor time and memory of `flatten` by the number of vertices, with a power law fitted to each, and a plot of both.

    WARPFLAT_DATA=DIR python benchmarks/scaling.py [--sizes 1000 4000] [--kinds grid irregular garment] [--picture docs/scaling.png]

Each mesh is flattened in a fresh process of one thread, whose kernels a mesh of a thousand vertices of its kind has loaded. Seconds are
processor time of the fastest run (three below 50,000 vertices, else one), from the surface in memory to the result, datum, checks and
contact included. Bytes are the growth of the process at its peak. `grid` and `irregular` are the bodice of `meshes.py`; `garment` is the
draped shirt front `garment_shirtfront.obj` of WARPFLAT_DATA, meshed anew. An exponent of 1 is a cost that grows as the vertices do.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from machine import cost_of_flatten
from meshes import Mesh, garment, grid, irregular

_SIZES = (1_000, 4_000, 16_000, 64_000, 250_000, 1_000_000)


def _shirt_front(size: int) -> Mesh:
    folder = os.environ.get("WARPFLAT_DATA", Path(__file__).parents[2] / "shared" / "data")
    return garment(Path(folder) / "garment_shirtfront.obj", size)


_KINDS: dict[str, Callable[[int], Mesh]] = {
    "grid": lambda size: grid("bodice", size),
    "irregular": lambda size: irregular("bodice", size),
    "garment": _shirt_front,
}


def exponent(rows: list[dict[str, Any]], key: str) -> float:
    """Return p of the power law key = c vertices^p that is nearest in logarithms."""
    return float(np.polyfit(np.log([row["vertices"] for row in rows]), np.log([row[key] for row in rows]), 1)[0])


def draw(path: Path, rows: list[dict[str, Any]]) -> None:
    """Plot seconds and bytes per vertex over vertices, each kind with its exponents."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    for axis, key, scale, label in (
        (axes[0], "seconds", 1e6, "processor time a vertex [µs]"),
        (axes[1], "bytes", 1e-3, "peak memory a vertex [kB]"),
    ):
        for kind in dict.fromkeys(row["kind"] for row in rows):
            of = [row for row in rows if row["kind"] == kind]
            each = [scale * row[key] / row["vertices"] for row in of]
            total = exponent(of, key) if len(of) > 1 else float("nan")
            axis.loglog(
                [row["vertices"] for row in of], each, marker="o", label=f"{kind}: total grows as V^{total:.2f}"
            )
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("")
        axis.set_xlabel("vertices V")
        axis.set_ylabel(label)
        axis.grid(True, which="both", linewidth=0.3)
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the table, mesh by mesh, and the exponents."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(_SIZES), metavar="VERTICES")
    parser.add_argument("--kinds", nargs="+", choices=list(_KINDS), default=list(_KINDS))
    parser.add_argument("--picture", type=Path, metavar="FILE", help="the plot")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="the figures; rows that it has are not measured again"
    )
    chosen = parser.parse_args()
    os.environ["WARPFLAT_THREADS"] = "1"
    rows: list[dict[str, Any]] = json.loads(chosen.json.read_text()) if chosen.json and chosen.json.exists() else []
    print(f"{'kind':10} {'vertices':>10} {'s':>8} {'us a vertex':>12} {'bytes a vertex':>15}")
    for kind in chosen.kinds:
        warm = _KINDS[kind](1_000)
        for size in chosen.sizes:
            found = [row for row in rows if (row["kind"], row["size"]) == (kind, size)]
            if not found:
                mesh = _KINDS[kind](size)
                repeats = 3 if size < 50_000 else 1
                memory, seconds = cost_of_flatten(mesh, "warpflat", warm=warm, repeats=repeats)
                row = {"kind": kind, "size": size, "vertices": len(mesh.surface.vertices)}
                found = [row | {"seconds": seconds, "bytes": memory}]
                rows += found
                if chosen.json:
                    chosen.json.write_text(json.dumps(rows, indent=1))
            row = found[0]
            print(
                f"{kind:10} {row['vertices']:10,} {row['seconds']:8.3f} {1e6 * row['seconds'] / row['vertices']:12.1f} "
                f"{row['bytes'] / row['vertices']:15,.0f}",
                flush=True,
            )
        of = [row for row in rows if row["kind"] == kind]
        if len(of) > 1:
            print(f"{kind}: seconds grow as V^{exponent(of, 'seconds'):.2f}, bytes as V^{exponent(of, 'bytes'):.2f}")
    if chosen.picture:
        draw(chosen.picture, rows)


if __name__ == "__main__":
    sys.exit(main())
