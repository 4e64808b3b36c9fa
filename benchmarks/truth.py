"""How far flat pieces lie from the panels that a garment was sewn from.

    WARPFLAT_DATA=DIR python benchmarks/truth.py [FILE ...] [--fabric jersey] [--bands "as worn"] [--hang 0.0165]

A worn garment whose texture is its sewn pattern (Style3D, CLO, GarmentCode) says what its flat pieces should be. Each island is flattened
and laid on its panel, turned, moved and perhaps mirrored, never scaled; the distances of all vertices are measured in millimetres. Rows:
the whole garment as `warpflat flatten` leaves it ("sewn"), with `--hang` the same after the weight of the cloth below is taken off
("unhung"), each panel on its own ("alone"), and beside them libigl's ARAP and LSCM, where it is installed. Columns of a panel: mean, 95 %
of its vertices, 95 % of those on its outline. The last lines are means over all panels, weighted by their areas; and without bands, which
lie far off where they are not cut straight.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.flattening.flatten_all import flatten_all
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.io.read import read_mesh_file
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.construction.laid_as_cut import distances_laid
from warpflat.garment.construction.sew_pieces import Bands, sew_pieces
from warpflat.garment.construction.sewn_panels import SewnPanel, sewn_panels

FloatArray = NDArray[np.float64]

# A panel is a band where the square of its outline is so many times its area.
_BAND = 40.0
# Heights at which the weight below is summed up, and the least length that carries it [m].
_STEPS, _LEAST_AROUND = 200, 0.05


def outline(panel: SewnPanel) -> NDArray[np.int32]:
    """Return the vertices along the border."""
    return np.concatenate(border_loops(panel.surface.faces))


def is_band(panel: SewnPanel) -> bool:
    """Return whether a panel is long and narrow."""
    around = sum(polyline_length(panel.cut[np.append(loop, loop[0])]) for loop in border_loops(panel.surface.faces))
    return around**2 > _BAND * panel.area


def measure(panel: SewnPanel, layout: FloatArray) -> tuple[float, float, float]:
    """Return mean, 95 % of all vertices, and 95 % of those on the outline of a layout's distances from the panel [mm]."""
    off = 1e3 * distances_laid(layout, panel.cut)
    return float(off.mean()), float(np.percentile(off, 95)), float(np.percentile(off[outline(panel)], 95))


def peers(panel: SewnPanel) -> dict[str, FloatArray]:
    """Return the layouts of libigl's LSCM, of the cloth's area, and ARAP, from there; none where it is not installed."""
    try:
        import igl
    except ImportError:
        return {}
    v, faces = panel.surface.vertices, panel.surface.faces
    quads = faces[faces[:, 3] >= 0]
    t = np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]]).astype(np.int64)
    border = max(border_loops(faces), key=len).astype(np.int64)
    # Far apart in space: two sides of a seam are at one place.
    first = border[np.argmax(np.linalg.norm(v[border] - v[border[0]], axis=1))]
    pins = np.array([first, border[np.argmax(np.linalg.norm(v[border] - v[first], axis=1))]])
    reach = float(np.linalg.norm(v[pins[1]] - v[pins[0]]))
    lscm = np.ascontiguousarray(igl.lscm(v, t, pins, np.array([[0.0, 0.0], [reach, 0.0]]))[0])
    lscm *= np.sqrt(panel.worn_area / max(float(flat_areas(lscm, triangulate(panel.surface.faces)[0]).sum()), 1e-12))
    data = igl.ARAPData()
    data.max_iter = 100
    pin = border[:1].astype(np.int32)
    igl.arap_precomputation(v, t, 2, pin, data)
    return {"ARAP": np.asarray(igl.arap_solve(lscm[pin].copy(), data, lscm))[:, :2], "LSCM": lscm}


def unhung(panels: Sequence[SewnPanel], hang: float) -> list[Surface]:
    """Return the worn panels lower and shorter by what the weight of the cloth below each height has stretched them.

    What hangs below a height is carried along the line of the garment at that height, whose length follows from the area between two
    heights and its slope (coarea formula). What body and friction carry is not known.

    Args:
        panels: of one garment, Y up.
        hang: strain of a strip under its own weight for each metre of it [1/m]: weight over stiffness.
    """
    corners = [panel.surface.vertices[triangulate(panel.surface.faces)[0]] for panel in panels]
    a, b, c = np.concatenate(corners).transpose(1, 0, 2)
    vector = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(vector, axis=1)
    slope = np.sqrt(np.maximum(1.0 - (vector[:, 1] / np.maximum(area, 1e-30)) ** 2, 0.0))
    ends = np.stack([a[:, 1], b[:, 1], c[:, 1]])
    low, high = ends.min(axis=0), ends.max(axis=0)
    steps = np.linspace(low.min(), high.max(), _STEPS + 1)
    below = np.zeros((2, _STEPS + 1))
    for k, step in enumerate(steps):
        share = np.clip((step - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
        below[:, k] = share @ area, share @ (area * slope)
    around = np.diff(below[1]) / (steps[1] - steps[0])
    strain = hang * 0.5 * (below[0, 1:] + below[0, :-1]) / np.maximum(around, _LEAST_AROUND)
    lower = np.append(0.0, np.cumsum((steps[1] - steps[0]) / (1.0 + strain)))
    return [
        replace(
            panel.surface,
            vertices=np.column_stack([x := panel.surface.vertices, np.interp(x[:, 1], steps, lower)])[:, [0, 3, 2]],
        )
        for panel in panels
    ]


def layouts(
    panels: Sequence[SewnPanel], fabric: str, bands: Bands = "auto", hang: float | None = None
) -> dict[str, list[FloatArray]]:
    """Return each way of flattening with its layout of every panel; `bands` of those that are sewn are cut straight."""
    surfaces = [panel.surface for panel in panels]
    alone = flatten_all(surfaces, fabric=fabric)

    def sewn(pieces: Sequence[Flattening]) -> list[FloatArray]:
        garment = sew_pieces(pieces, eased=True, bands=bands)
        return [garment.pieces[surface.name].positions for surface in surfaces]

    found = {
        "sewn": sewn(alone),
        **({} if hang is None else {"unhung": sewn(flatten_all(unhung(panels, hang), fabric=fabric))}),
        "alone": [piece.positions for piece in alone],
    }
    for panel in panels:
        for name, layout in peers(panel).items():
            found.setdefault(name, []).append(layout)
    return found


def table(panels: Sequence[SewnPanel], found: Mapping[str, Sequence[FloatArray]]) -> list[str]:
    """Return the lines of the table of one garment."""
    lines = [f"  {'panel':28}" + "".join(f"{name:>20}" for name in found)]
    measured = {
        name: [measure(p, layout) for p, layout in zip(panels, rows, strict=True)] for name, rows in found.items()
    }
    for number, panel in enumerate(panels):
        size = np.sort(1e3 * np.ptp(panel.cut, axis=0))
        kind = "band" if is_band(panel) else "body"
        what = f"{panel.surface.name} {kind} {size[1]:.0f} x {size[0]:.0f}"
        cells = ("{:.2f} {:.2f} {:.2f}".format(*rows[number]) for rows in measured.values())
        lines.append(f"  {what:28}" + "".join(f"{cell:>20}" for cell in cells))
    for title, chosen in (("all", [True] * len(panels)), ("body", [not is_band(panel) for panel in panels])):
        weight = np.array([panel.area for panel in panels]) * chosen
        if not weight.any():
            continue
        means = (weight @ np.array(rows) / weight.sum() for rows in measured.values())
        cells = ("{:.2f} {:.2f} {:.2f}".format(*row) for row in means)
        lines.append(f"  {title:28}" + "".join(f"{cell:>20}" for cell in cells))
    return lines


def main() -> int:
    """Print the table of every garment; the exit code is 1 where there is none."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--units", help="of the files, where they do not say")
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--bands", default="auto", choices=get_args(Bands), help="that are cut straight")
    parser.add_argument(
        "--hang",
        type=float,
        help="weight over warp stiffness: strain for each metre of cloth below [1/m]",
    )
    given = parser.parse_args()
    files = given.files
    if not files:
        folder = os.environ.get("WARPFLAT_DATA")
        files = sorted((Path(folder) / "garments").glob("*_*irt.usd")) if folder else []
    done = 0
    for file in files:
        try:
            _, raw, scale, _ = read_mesh_file(file, units=given.units, prim=None, name=None)
            panels = sewn_panels(raw, scale)
        except InputError as error:
            print(f"{file.name}: left out: {error}")
            continue
        print(f"{file.name}: mean, 95 %, 95 % of the outline [mm], fabric {given.fabric}, bands {given.bands}")
        print("\n".join(table(panels, layouts(panels, given.fabric, given.bands, given.hang))), flush=True)
        done += 1
    if not done:
        print("no garment whose texture is its pattern; give files, or set WARPFLAT_DATA", file=sys.stderr)
    return 0 if done else 1


if __name__ == "__main__":
    sys.exit(main())
