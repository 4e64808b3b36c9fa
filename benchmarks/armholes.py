"""Measure armholes and sleeves of forms on many bodies: `WARPFLAT_DATA=DIR python benchmarks/armholes.py [--picture FILE]`.

One line per body and piece: cells over, sharpest turn of armhole or cap [degrees per cm] and its changes of bend, the
angle between armhole and side seam; of sleeves the underarm seam and what the cap has more than the armhole [mm]; how deep
forms lie inside the body [mm].
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from warpflat.garment.garment import Garment, flatten_form
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.scan_pose import ScanOptions
from warpflat.surface.io.read import read_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "mannequin"))
from armhole_curves import corner_degrees, depth_inside, inflections, sharpest_turn

SCANS = ("female", "male", "male_heavy", "child")
MEASURED = {
    "EU 34": {"bust": 0.80, "waist": 0.64, "hip": 0.88},
    "EU 46": {"bust": 1.04, "waist": 0.88, "hip": 1.12},
    "child 128": {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28, "shoulder": 0.095},
}
SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44", "men 46", "men 50", "men 56")
FORMS = {"basic_block": "woven", "tshirt": "interlock"}


def bodies(resolution: float, names: list[str]) -> Iterator[tuple[str, Mannequin]]:
    """Yield the bodies by name, made to measurements, from tables, and from scans."""
    for name, given in MEASURED.items():
        if not names or name in names:
            yield name, Mannequin.from_measurements(resolution_mm=resolution, **given)
    for name in SIZES:
        if not names or name in names:
            yield name, Mannequin.from_size(name, resolution_mm=resolution)
    folder = os.environ.get("WARPFLAT_DATA")
    for name in SCANS if folder else ():
        if not names or name in names:
            points, faces = read_scan(Path(str(folder)) / f"body_{name}.obj")
            yield name, Mannequin.from_scan(points, faces, options=ScanOptions(mirror=True), resolution_mm=resolution)


def measure(garment: Garment) -> Iterator[str]:
    """Yield a line for every piece with an armhole on the left."""
    length = {
        seam: np.sum([s.lengths for s in garment.seams if s.name.startswith(seam)], axis=0)
        for seam in ("armhole left",)
    }
    for name, piece in garment.form.pieces.items():
        edges, flat = piece.edges, garment.pieces[name]
        if "armhole left" not in edges:
            continue
        curve = flat.positions[edges["armhole left"]]
        line = f"  {garment.name:11} {name:13} over {flat.flipped_faces} turn {sharpest_turn(curve):5.1f} bends {inflections(curve)}"
        if "underarm left" in edges:
            seams = [
                np.linalg.norm(np.diff(flat.positions[edges[k]], axis=0), axis=1).sum()
                for k in ("underarm left", "underarm left 2")
            ]
            cap = 1000.0 * float(np.ptp(length["armhole left"]))
            height = 1000.0 * cap_height(curve)
            line += f" underarm {1000 * seams[0]:4.0f} {1000 * seams[1]:4.0f} cap over armhole {cap:+5.1f} height {height:4.0f}"
        else:
            line += f" corner {corner_degrees(flat.positions, edges['armhole left'], edges['side left']):5.1f}"
        yield line


def cap_height(cap: np.ndarray) -> float:
    """Return how far the cap rises over the straight line between its ends [m]."""
    way = cap[-1] - cap[0]
    away = (cap - cap[0]) @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
    return float(np.abs(away).max())


def main() -> None:
    """Print the table; draw the pieces if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", nargs="*", help="names of bodies; all of them without")
    parser.add_argument("--resolution", type=float, default=10.0, help="quad edge [mm]")
    parser.add_argument("--forms", nargs="+", default=list(FORMS))
    parser.add_argument("--picture", type=Path, help="draw all outlines and grids into this file")
    given = parser.parse_args()
    drawn: list[tuple[str, Garment]] = []
    for name, body in bodies(given.resolution, given.bodies):
        print(name)
        for form in given.forms:
            made = body.form(form)
            inside = 1000.0 * depth_inside(made, body)
            garment = flatten_form(body, made, fabric=FORMS.get(form, "woven"))
            drawn.append((name, garment))
            print(*measure(garment), f"  {form:11} inside the body {inside:.1f} mm", sep="\n", flush=True)
    if given.picture:
        draw(drawn, given.picture)


def draw(garments: list[tuple[str, Garment]], path: Path) -> None:
    """Draw the pieces with armholes, one garment a row, right sleeves left out."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = []
    for body, garment in garments:
        chosen = [name for name, piece in garment.form.pieces.items() if "armhole left" in piece.edges]
        rows.append((body, garment, chosen))
    wide = max(len(chosen) for *_, chosen in rows)
    figure, axes = plt.subplots(len(rows), wide, figsize=(5 * wide, 5 * len(rows)), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
        axis.set_aspect("equal")
    for (body, garment, chosen), line in zip(rows, axes, strict=True):
        for name, axis in zip(chosen, line, strict=False):
            flat = garment.pieces[name]
            corner = flat.positions[garment.form.pieces[name].surface.faces]
            axis.plot(
                *np.moveaxis(np.concatenate([corner, corner[:, :1]], axis=1), 2, 0).transpose(0, 2, 1), "0.7", lw=0.4
            )
            for ids in garment.form.pieces[name].edges.values():
                axis.plot(*flat.positions[ids].T, "k", lw=1.2)
            axis.set_title(f"{body} {garment.name} {name}", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=55)


if __name__ == "__main__":
    main()
