"""Measure forms on ten sizes and four scans: `WARPFLAT_DATA=DIR python benchmarks/forms.py [BODY ...] [--picture FILE]`.

One line per body and form: cells over, largest difference of a seam's sides [mm], whether it converged, how deep the form
lies inside the body [mm]; of armholes (front, back) and cap the sharpest turn [degrees per cm], of armholes the angle to the
side seam, of sleeves the underarm seam, the cap's height and what it has more than the armhole [mm]. `OVER`: a figure out of
bounds. `--shape darts` gives all of them a book's darts. `--inside` measures the depth of every form and flattens none.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.io.read import read_scan
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.mannequin.forms import form_names, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.shapes import shaped_form

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "garment" / "mannequin"))
from armhole_curves import corner_degrees, depth_inside, inflections, sharpest_turn

SCANS = ("female", "male", "male_heavy", "child")
MEASURED = {
    "EU 34": {"bust": 0.80, "waist": 0.64, "hip": 0.88},
    "EU 46": {"bust": 1.04, "waist": 0.88, "hip": 1.12},
    "child 128": {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28, "shoulder": 0.095},
}
SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44", "men 46", "men 50", "men 56")
#: Forms by the cloth that they are cut from.
FORMS = {"bodice": "woven", "basic_block": "woven", "tshirt": "interlock", "dress": "woven", "trousers": "woven"}
#: Bounds: a seam's difference and the depth inside the body [mm], sharpest turn of an armhole and of a cap [degrees per cm].
SEAM, INSIDE, ARMHOLE, CAP = 0.2, 0.1, 46.0, 20.0


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
            yield name, Mannequin.from_scan(points, faces, resolution_mm=resolution)


def measure(garment: Garment, inside: float) -> str:
    """Return a garment's line of the table; `inside` [m]."""
    over = sum(piece.flipped_faces for piece in garment.pieces.values())
    sewn = garment.sewn
    seam = 1000.0 * max((abs(seam.difference) for seam in garment.seams), default=0.0)
    converged = sewn is not None and sewn.converged
    bad = over > 0 or seam > SEAM or not converged or 1000.0 * inside > INSIDE
    line = f"over {over} seams {seam:.3f} {'converged' if converged else 'NOT CONVERGED'} inside {1000 * inside:.2f}"
    for name, piece in garment.form.pieces.items():
        edges, flat = piece.edges, garment.pieces[name].positions
        if "armhole left" not in edges:
            continue
        curve = flat[edges["armhole left"]]
        turn = sharpest_turn(curve)
        line += f" | {name} turn {turn:.0f} bends {inflections(curve)}"
        if "underarm left" in edges:
            under = 1000.0 * polyline_length(flat[edges["underarm left"]])
            line += f" underarm {under:.0f} height {1000 * cap_height(curve):.0f} cap {cap_ease_mm(garment):+.1f}"
            bad |= turn > CAP
        else:
            # A bust dart parts the side seam.
            sides = (ids for edge, ids in edges.items() if piece.parts.get(edge, edge) == "side left")
            for side in (ids for ids in sides if np.isin(ids, edges["armhole left"]).any()):
                line += f" corner {corner_degrees(flat, edges['armhole left'], side):.0f}"
                bad |= turn > ARMHOLE
    return line + ("  OVER" if bad else "")


def cap_ease_mm(garment: Garment) -> float:
    """Return what the left cap has more than its armhole [mm]."""
    armhole, cap = np.sum([seam.lengths for seam in garment.seams if seam.name.endswith("armhole left")], axis=0)
    return 1000.0 * float(cap - armhole)


def cap_height(cap: np.ndarray) -> float:
    """Return how far the cap rises over the straight line between its ends [m]."""
    way = cap[-1] - cap[0]
    away = (cap - cap[0]) @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
    return float(np.abs(away).max())


def main() -> None:
    """Print the table; draw the pieces if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", nargs="*", help="names of bodies; all of them without")
    parser.add_argument("--resolution", type=float, default=15.0, help="quad edge [mm]")
    parser.add_argument("--forms", nargs="+", default=list(FORMS))
    parser.add_argument("--shape", default="none", choices=("none", "darts", "princess"))
    parser.add_argument("--inside", action="store_true", help="the depth inside the body only, of every shipped form")
    parser.add_argument("--picture", type=Path, help="draw all outlines and grids into this file")
    given = parser.parse_args()
    drawn: list[tuple[str, Garment]] = []
    for name, body in bodies(given.resolution, given.bodies):
        if given.inside:
            depths = {form: 1000.0 * depth_inside(body.form(form), body) for form in form_names()}
            print(f"{name:11}", *(f"{form} {depth:.2f}" for form, depth in depths.items()), flush=True)
            continue
        for form in given.forms:
            made = body.form(shaped_form(body.layout, shipped_form(form), given.shape, body.vertices))
            garment = flatten_form(body, made, fabric=FORMS.get(form, "woven"))
            drawn.append((name, garment))
            print(f"{name:11} {form:11} {measure(garment, depth_inside(made, body))}", flush=True)
    if given.picture:
        draw(drawn, given.picture)


def draw(garments: list[tuple[str, Garment]], path: Path) -> None:
    """Draw the pieces, one garment a row, those of the right side left out."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection

    rows = []
    for body, garment in garments:
        chosen = [name for name in garment.pieces if not name.endswith("right")]
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
            axis.add_collection(PolyCollection(list(corner), facecolors="none", edgecolors="0.7", linewidths=0.4))
            for ids in garment.form.pieces[name].edges.values():
                axis.plot(*flat.positions[ids].T, "k", lw=1.2)
            axis.set_title(f"{body} {garment.name} {name}", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=55)


if __name__ == "__main__":
    main()
