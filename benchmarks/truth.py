"""How far flat pieces lie from the panels that a garment was sewn from.

    WARPFLAT_DATA=DIR python benchmarks/truth.py [FILE ...] [--fabric jersey] [--bands "as worn"]

A worn garment whose texture is its sewn pattern (Style3D, CLO, GarmentCode) says what its flat pieces should be. Each island is flattened
and laid on its panel, turned, moved and perhaps mirrored, never scaled; the distances of all vertices are measured in millimetres. Rows:
the whole garment as `warpflat flatten` leaves it ("sewn"), each panel on its own by springs and by the membrane, and beside them
libigl's ARAP and LSCM, where it is installed. Columns of a panel: mean, 95 % of its vertices, 95 % of those on its outline. The last
lines are means over all panels, weighted by their areas; and without bands, which lie far off where they are not cut straight.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

import warpflat
from warpflat.core.errors import InputError
from warpflat.flattening.flatten_all import flatten_all
from warpflat.garment.sew_pieces import Bands, sew_pieces
from warpflat.surface.connectivity import border_loops
from warpflat.surface.io.file_seams import file_seams
from warpflat.surface.io.read import RawMesh, read_mesh_file
from warpflat.surface.mesh import Surface

FloatArray = NDArray[np.float64]

# Units in which a texture may be [m]; and by how much its area may differ from the cloth's.
_UNITS, _TRUE_SIZE = (1.0, 0.1, 0.01, 0.001), 0.25
# Islands of fewer faces are no panels.
_FEWEST = 50
# A panel is a band where the square of its outline is so many times its area.
_BAND = 40.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A sewn panel: how it is worn, and how it was cut.

    Attributes:
        surface: as worn, #V vertices.
        cut: #V by 2, the same vertices in the pattern [m].
    """

    surface: Surface
    cut: FloatArray

    @property
    def outline(self) -> NDArray[np.int32]:
        """The vertices along the border."""
        return np.concatenate(border_loops(self.surface.faces))

    @property
    def area(self) -> float:
        """The area of the cloth as it was cut [m2]."""
        return _area(self.cut, self.surface.faces)

    @property
    def is_band(self) -> bool:
        """Whether it is long and narrow."""
        around = sum(
            float(np.linalg.norm(np.diff(self.cut[np.append(loop, loop[0])], axis=0), axis=1).sum())
            for loop in border_loops(self.surface.faces)
        )
        return around**2 > _BAND * self.area


def _area(points: FloatArray, faces: NDArray[np.int32]) -> float:
    """Return the area of faces of three or four corners in space or in the plane, whichever way they turn."""
    flat = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    corner = flat[faces]
    corner[faces[:, 3] < 0, 3] = corner[faces[:, 3] < 0, 0]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    return float(0.5 * np.linalg.norm(normal, axis=1).sum())


def panels_of(raw: RawMesh, scale: float) -> list[Panel]:
    """Return the panels of a garment whose texture is its pattern, in a unit that is found by area.

    Args:
        raw: the mesh.
        scale: metres per unit of its points.

    Raises:
        ValueError: it has no texture, or one that is not of true size in any unit.
    """
    if raw.texture is None:
        raise ValueError("the file has no texture")
    found: list[Panel] = []
    island = file_seams(raw)["uv"].island
    for number in range(int(island.max()) + 1):
        polygons, texture = raw.polygons[island == number], raw.texture[island == number]
        used = polygons >= 0
        if len(polygons) < _FEWEST:
            continue
        places, corner = np.unique(texture[used], axis=0, return_inverse=True)
        faces = np.full((len(polygons), 4), -1, dtype=np.int32)
        faces[:, : polygons.shape[1]][used] = corner.ravel()
        worn = np.zeros((len(places), 3))
        worn[corner.ravel()] = raw.vertices[polygons[used]] * scale
        surface = warpflat.make_surface(worn, faces, name=f"panel_{number}")
        found.append(Panel(surface=surface, cut=places[surface.input_index]))
    worn_area = sum(_area(panel.surface.vertices, panel.surface.faces) for panel in found)
    cut_area = sum(panel.area for panel in found)
    unit = min(_UNITS, key=lambda unit: abs(np.log(unit**2 * cut_area / worn_area)))
    if abs(unit**2 * cut_area / worn_area - 1.0) > _TRUE_SIZE:
        raise ValueError("the texture is not of true size")
    return [Panel(surface=panel.surface, cut=unit * panel.cut) for panel in found]


def distances(layout: FloatArray, cut: FloatArray) -> FloatArray:
    """Return how far each place lies from its own in the cut panel, #V, when laid on it, turned, moved, and mirrored if that is nearer.

    Source: Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.

    Args:
        layout, cut: #V by 2 [m].
    """
    a, b = layout - layout.mean(axis=0), cut - cut.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    sign = np.diag([1.0, np.linalg.det(u @ v)])
    laid = [a @ u @ mirror @ v for mirror in (sign, sign @ np.diag([1.0, -1.0]))]
    return min((np.linalg.norm(each - b, axis=1) for each in laid), key=lambda row: float(row.mean()))


def measure(panel: Panel, layout: FloatArray) -> tuple[float, float, float]:
    """Return mean, 95 % of all vertices, and 95 % of those on the outline of a layout's distances from the panel [mm]."""
    off = 1e3 * distances(layout, panel.cut)
    return float(off.mean()), float(np.percentile(off, 95)), float(np.percentile(off[panel.outline], 95))


def peers(panel: Panel) -> dict[str, FloatArray]:
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
    lscm *= np.sqrt(_area(v, faces) / max(_area(lscm, faces), 1e-12))
    data = igl.ARAPData()
    data.max_iter = 100
    pin = border[:1].astype(np.int32)
    igl.arap_precomputation(v, t, 2, pin, data)
    return {"ARAP": np.asarray(igl.arap_solve(lscm[pin].copy(), data, lscm))[:, :2], "LSCM": lscm}


def layouts(panels: Sequence[Panel], fabric: str, bands: Bands = "auto") -> dict[str, list[FloatArray]]:
    """Return each way of flattening with its layout of every panel; `bands` of those that are sewn are cut straight."""
    surfaces = [panel.surface for panel in panels]
    alone = flatten_all(surfaces, fabric=fabric)
    sewn = sew_pieces(alone, eased=True, bands=bands)
    found = {
        "sewn": [sewn.pieces[surface.name].positions for surface in surfaces],
        "springs": [piece.positions for piece in alone],
        "membrane": [piece.positions for piece in flatten_all(surfaces, fabric=fabric, model="membrane")],
    }
    for panel in panels:
        for name, layout in peers(panel).items():
            found.setdefault(name, []).append(layout)
    return found


def table(panels: Sequence[Panel], found: Mapping[str, Sequence[FloatArray]]) -> list[str]:
    """Return the lines of the table of one garment."""
    lines = [f"  {'panel':28}" + "".join(f"{name:>20}" for name in found)]
    measured = {
        name: [measure(p, layout) for p, layout in zip(panels, rows, strict=True)] for name, rows in found.items()
    }
    for number, panel in enumerate(panels):
        size = np.sort(1e3 * np.ptp(panel.cut, axis=0))
        kind = "band" if panel.is_band else "body"
        what = f"{panel.surface.name} {kind} {size[1]:.0f} x {size[0]:.0f}"
        cells = ("{:.2f} {:.2f} {:.2f}".format(*rows[number]) for rows in measured.values())
        lines.append(f"  {what:28}" + "".join(f"{cell:>20}" for cell in cells))
    for title, chosen in (("all", [True] * len(panels)), ("body", [not panel.is_band for panel in panels])):
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
    given = parser.parse_args()
    files = given.files
    if not files:
        folder = os.environ.get("WARPFLAT_DATA")
        files = sorted((Path(folder) / "garments").glob("*_*irt.usd")) if folder else []
    done = 0
    for file in files:
        try:
            _, raw, scale, _ = read_mesh_file(file, units=given.units, prim=None, name=None)
            panels = panels_of(raw, scale)
        except (InputError, ValueError) as error:
            print(f"{file.name}: left out: {error}")
            continue
        print(f"{file.name}: mean, 95 %, 95 % of the outline [mm], fabric {given.fabric}, bands {given.bands}")
        print("\n".join(table(panels, layouts(panels, given.fabric, given.bands))), flush=True)
        done += 1
    if not done:
        print("no garment whose texture is its pattern; give files, or set WARPFLAT_DATA", file=sys.stderr)
    return 0 if done else 1


if __name__ == "__main__":
    sys.exit(main())
