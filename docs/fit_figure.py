"""Draw docs/fit.png: a T-shirt made for EU 38, and as `warpflat fit` carries it to two other bodies.

python docs/fit_figure.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.collections import PolyCollection

import warpflat
from warpflat.app.scene.fit import FitJob
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.pattern.export.figure import new_figure, write_figure

BODIES = ("EU 38", "EU 44", "men 54")
SKIN, CLOTH, LIGHT = (0.86, 0.78, 0.71), (0.36, 0.52, 0.68), np.array([0.3, 0.4, 0.87])


def main(file: str) -> None:
    """Carry the T-shirt and write the figure to `file`."""
    form = warpflat.Mannequin.from_size(BODIES[0]).form("tshirt")
    faces = np.concatenate([piece.grid_vertices[piece.surface.faces] for piece in form.pieces.values()])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tshirt.obj"
        rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in form.vertices.tolist()]
        path.write_text("\n".join([*rows, *("f " + " ".join(str(v + 1) for v in f) for f in faces.tolist()), ""]))
        job = FitJob.start(path, units="m", body=BODIES[0])
        figure = new_figure(11.0, 3.9, dpi=110)
        for number, body in enumerate(BODIES):
            carried = job.to(body, {})
            axes = figure.add_axes((0.01 + 0.33 * number, 0.07, 0.32, 0.86))
            # What faces the viewer, the cloth over the skin.
            for points, corners, colour in (
                (carried.skin, finer_body()[1], SKIN),
                (carried.vertices, triangulate(faces.astype(np.int32))[0], CLOTH),
            ):
                corner = points[corners]
                normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
                corner, normal = corner[normal[:, 2] > 0.0], normal[normal[:, 2] > 0.0]
                corner, normal = (part[np.argsort(corner[:, :, 2].mean(axis=1))] for part in (corner, normal))
                bright = 0.55 + 0.45 * np.abs(normal @ LIGHT) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
                shades = np.clip(np.array(colour) * bright[:, None], 0.0, 1.0)
                axes.add_collection(
                    PolyCollection(corner[:, :, :2], facecolors=shades, edgecolors=shades, linewidths=0.3)
                )
            axes.set_xlim(-0.68, 0.68)
            axes.set_ylim(0.72, 1.9)
            axes.set_aspect("equal")
            axes.axis("off")
            ease = ", ".join(f"{level} {1e3 * (a - b):+.0f}" for level, (a, b) in carried.after.items())
            axes.set_title(f"{body}{' (made for)' if number == 0 else ''}", fontsize=11)
            axes.text(0.5, -0.03, f"ease [mm]: {ease}", transform=axes.transAxes, ha="center", fontsize=8)
            print(carried.verdict())
        write_figure(file, figure)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(Path(__file__).with_name("fit.png")))
