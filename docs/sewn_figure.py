"""Draw docs/sewn.png: a shirt as `warpflat drape` sews it and puts it on, from the front and the back, beside the pieces of its paper.

python docs/sewn_figure.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from warpflat.flat.surface.normals import vertex_normals
from warpflat.flat.surface.triangles import triangulate
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.export.figure import new_figure, write_figure
from warpflat.pattern.export.pattern_json import read_pattern_json
from warpflat.pattern.export.raster import Lighting, rasterise, shade

SKIN, CLOTH, LIGHT = (0.86, 0.78, 0.71), (0.36, 0.52, 0.68), (-0.35, 0.45, 0.82)
# The cloth is drawn this much nearer than the body below it [m].
NEARER = 0.01
# A pixel [m], and samples of it along either side.
PIXEL, SAMPLES = 0.0018, 3
# What is shown around the cloth [m].
BELOW, ABOVE = (-0.06, -0.05, -0.3), (0.06, 0.01, 0.3)

#: A mesh: vertices, triangles and colour.
Part = tuple[np.ndarray, np.ndarray, tuple[float, float, float]]


def make(folder: Path) -> None:
    """Make a shirt, and drape it, in a folder."""
    program = [sys.executable, "-m", "warpflat"]
    subprocess.run([*program, "new", "shirt", "--size", "EU 38", "--out", str(folder / "shirt.toml")], check=True)
    subprocess.run([*program, "run", str(folder / "shirt.toml"), "--out", str(folder / "shirt")], check=True)
    subprocess.run([*program, "drape", str(folder / "shirt"), "--out", str(folder / "worn")], check=True)


def meshes(film: Path) -> Iterator[Part]:
    """Yield body and cloth of a drape: vertices, triangles and colour."""
    stage = Usd.Stage.Open(str(film))
    for name, colour in (("body", SKIN), ("cloth", CLOTH)):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/drape/{name}"))
        corners, counts = (
            np.array(each.Get()) for each in (mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr())
        )
        faces = np.full((len(counts), 4), -1, dtype=np.int32)
        faces[np.arange(4) < counts[:, None]] = corners
        yield np.array(mesh.GetPointsAttr().Get(stage.GetEndTimeCode()), dtype=float), triangulate(faces)[0], colour


def seen(shown: Sequence[Part], low: np.ndarray, high: np.ndarray, sign: float) -> np.ndarray:
    """Return a picture of body and cloth between two corners [m], RGBA, from the front (sign 1) or the back (-1)."""
    size = np.ceil((high - low)[:2] / PIXEL).astype(int) * SAMPLES
    places, rows, normals, colours = [], [], [], []
    for points, triangles, colour in shown:
        middle = 0.5 * (low + high)
        turned = (points - middle) * [sign, 1.0, sign]
        normals.append(vertex_normals(turned, triangles))
        turned[:, 2] += NEARER if colour == CLOTH else 0.0
        rows.append(triangles + sum(len(each) for each in places))
        places.append(turned * [1.0, -1.0, 1.0] / PIXEL * SAMPLES + [*(0.5 * size), 0.0])
        colours.append(np.tile(colour, (len(triangles), 1)))
    corners, faces, colour = np.concatenate(places), np.concatenate(rows), np.concatenate(colours)
    samples = rasterise(corners, faces, (int(size[1]), int(size[0])))
    light = Lighting(normals=np.concatenate(normals), direction=LIGHT, back=CLOTH)
    return shade(samples, SAMPLES, corners, faces, colour, face=np.arange(len(faces)), lighting=light)


def main(file: str, folder: Path) -> None:
    """Write the figure to `file`, of a shirt that lies in a folder."""
    figure = new_figure(11.0, 3.5, dpi=110)
    shown = list(meshes(folder / "worn" / "frames.usdc"))
    low, high = shown[1][0].min(axis=0) + BELOW, shown[1][0].max(axis=0) + ABOVE
    for number, sign in enumerate((1.0, -1.0)):
        axes = figure.add_axes((0.35 * number, 0.01, 0.34, 0.98))
        axes.imshow(seen(shown, low, high, sign))
        axes.axis("off")
    axes = figure.add_axes((0.71, 0.02, 0.28, 0.96))
    sheet = lay_out(nests(read_pattern_json(folder / "shirt" / "pattern.json")), width=1.25)
    for placed in sheet.placed:
        for piece in placed.pieces:
            for line, style in ((piece.cut_line, "-"), (piece.sew_line, "--"), (piece.grain, "-")):
                points = placed.on_sheet(line)
                closed = np.vstack([points, points[:1]]) if len(line) > 2 else points
                axes.plot(*closed.T, style, color="0.15", linewidth=1.2 if line is piece.cut_line else 0.6)
    axes.set_aspect("equal")
    axes.axis("off")
    write_figure(file, figure)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        make(Path(made))
        main(str(Path(__file__).with_name("sewn.png")), Path(made))
