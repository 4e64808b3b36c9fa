"""Draw docs/sewn.png: a shirt as `warpflat drape` sews it and puts it on, from the front and the back, beside the pieces of its paper.

python docs/sewn_figure.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.export.dressed import Body, dress
from warpflat.pattern.export.figure import Pen, write_figure
from warpflat.pattern.export.pattern_json import read_pattern_json
from warpflat.pattern.export.views import SIDES, View, draw_row

CLOTH = (0.36, 0.52, 0.68)
# The cloth is drawn this much nearer than the body below it [m].
NEARER = 0.01


def make(folder: Path) -> None:
    """Make a shirt, and drape it, in a folder."""
    program = [sys.executable, "-m", "warpflat"]
    subprocess.run([*program, "new", "shirt", "--size", "EU 38", "--out", str(folder / "shirt.toml")], check=True)
    subprocess.run([*program, "run", str(folder / "shirt.toml"), "--out", str(folder / "shirt")], check=True)
    subprocess.run([*program, "drape", str(folder / "shirt"), "--out", str(folder / "worn")], check=True)


def mesh(film: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of the body or the cloth of a drape."""
    stage = Usd.Stage.Open(str(film))
    found = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/drape/{name}"))
    corners, counts = (
        np.array(each.Get()) for each in (found.GetFaceVertexIndicesAttr(), found.GetFaceVertexCountsAttr())
    )
    faces = np.full((len(counts), 4), -1, dtype=np.int32)
    faces[np.arange(4) < counts[:, None]] = corners
    return np.array(found.GetPointsAttr().Get(stage.GetEndTimeCode()), dtype=float), faces


def main(file: str, folder: Path) -> None:
    """Write the figure to `file`, of a shirt that lies in a folder."""
    film = folder / "worn" / "frames.usdc"
    vertices, body = mesh(film, "body")
    worn, cloth = mesh(film, "cloth")
    points, facets, skin = dress(Body(vertices=vertices, faces=body), worn, cloth)
    views = View.around(points, facets, (SIDES[0], SIDES[-1]))
    for view in views.values():
        view.points[: len(worn), 2] += NEARER
    shades = np.concatenate([np.tile(CLOTH, (len(cloth), 1)), skin])
    wide, high = views["front"].size[:2].tolist()
    scale = min(3.6 / wide, 3.2 / high)
    pen = Pen(11.0, 3.5, dpi=110)
    draw_row(pen, views, [shades] * 2, left=0.1, bottom=0.05, inches_per_metre=scale, gap=3.8 - scale * wide)
    axes = pen.figure.add_axes((0.71, 0.02, 0.28, 0.96))
    sheet = lay_out(nests(read_pattern_json(folder / "shirt" / "pattern.json")), width=1.25)
    for placed in sheet.placed:
        for piece in placed.pieces:
            for line, style in ((piece.cut_line, "-"), (piece.sew_line, "--"), (piece.grain, "-")):
                points = placed.on_sheet(line)
                closed = np.vstack([points, points[:1]]) if len(line) > 2 else points
                axes.plot(*closed.T, style, color="0.15", linewidth=1.2 if line is piece.cut_line else 0.6)
    axes.set_aspect("equal")
    axes.axis("off")
    write_figure(file, pen.figure)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        make(Path(made))
        main(str(Path(__file__).with_name("sewn.png")), Path(made))
