"""Garments sewn and worn again: distance to the designed surface, gaps, strain, and seconds until they are at rest.

    python benchmarks/drape.py [--garments bodice bodice+darts basic_block dress princess_dress] [--sizes "EU 38"]
        [--resolution 10] [--fabric woven] [--out DIR]

`bodice+darts` has a bust dart from either side to the princess line. A garment is worn without darts where its name says
nothing else. Everything is in millimetres but for strain (percent), pressure (pascals) and seconds.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

import warpflat


def dart_both_sides(front: warpflat.Flattening) -> warpflat.Flattening:
    """Cut the bust line from both sides to the princess lines."""
    line = front.surface.lines["bust"]
    steps = np.linalg.norm(np.diff(front.surface.vertices[line], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    crossings = []
    for name, ids in front.surface.lines.items():
        if name.startswith("princess front"):
            crossings += along[np.isin(line, ids)].tolist()
    parts = [(0.0, min(crossings)), (1.0, max(crossings))]
    paths = tuple(warpflat.line_part(front.surface, "bust", part) for part in parts)
    return warpflat.cut(front, warpflat.CutPlan(name="bust", paths=paths))


def worn(name: str, size: str, resolution: float, fabric: str) -> tuple[warpflat.Drape, float]:
    form, _, darts = name.partition("+")
    body = warpflat.Mannequin.from_size(size, resolution_mm=resolution)
    began = time.perf_counter()
    garment = warpflat.flatten_form(body, body.form(form), fabric=fabric, sewn=not darts)
    if darts:
        garment = replace(garment, pieces={**garment.pieces, "front": dart_both_sides(garment.pieces["front"])})
    flattened = time.perf_counter() - began
    return warpflat.drape(garment), flattened


def show(name: str, size: str, drape: warpflat.Drape, flattened: float) -> None:
    measures = drape.measures()
    rest = "at rest" if drape.converged else "NOT AT REST"
    print(
        f"\n{name}, {size}: {measures['vertices']:,} vertices, {rest} ({100 * measures['residual']:.2f} % of a weight) after "
        f"{measures['steps']:,} steps, {measures['seconds']:.1f} s (flattened in {flattened:.1f} s)"
    )
    for key in ("distance_m", "misfit_m", "bridged_m"):
        spread = "  ".join(f"{part} {1e3 * value:.2f}" for part, value in measures[key].items())
        print(f"  {key[:-2]:<10} {spread}")
    print(f"  deepest in the body {1e3 * measures['deepest_m']:.3f}")
    for key, factor in (("strain_warp", 100.0), ("strain_weft", 100.0), ("shear", 1.0)):
        print("  " + key + "  " + "  ".join(f"{part} {factor * value:.2f}" for part, value in measures[key].items()))
    print(f"  beyond a limit {100 * measures['outside']:.2f} %")
    print("  pressure  " + "  ".join(f"{part} {value:.3g}" for part, value in measures["pressure_pa"].items()))
    gaps = {line: 1e3 * gap for line, gap in measures["gap_m"].items() if "armhole" in line or "neck" in line}
    print("  gaps  " + "  ".join(f"{line} {gap:.1f}" for line, gap in gaps.items()))
    for place in measures["places"]:
        print(f"  - {place['words']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--garments", nargs="+", default=["bodice", "bodice+darts", "basic_block", "dress", "princess_dress"]
    )
    parser.add_argument("--sizes", nargs="+", default=["EU 38"])
    parser.add_argument("--resolution", type=float, default=10.0)
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    for size in given.sizes:
        for name in given.garments:
            drape, flattened = worn(name, size, given.resolution, given.fabric)
            show(name, size, drape, flattened)
            if given.out is not None:
                warpflat.save_drape(drape, given.out / f"{name} {size}")


if __name__ == "__main__":
    main()
