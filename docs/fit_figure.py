"""Draw docs/fit.png: a T-shirt made for EU 38, and as `warpflat fit` carries it to two other bodies.

python docs/fit_figure.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import warpflat
from warpflat.app.scene.fit import read_job
from warpflat.pattern.export.dressed import Body, dress
from warpflat.pattern.export.figure import drawn_page
from warpflat.pattern.export.views import View, draw_row

BODIES = ("EU 38", "EU 44", "men 54")
CLOTH = (0.36, 0.52, 0.68)
# Inches per metre; and the cloth is drawn this much nearer than the body below it [m].
SCALE, NEARER = 4.0, 0.01


def main(file: str) -> None:
    """Carry the T-shirt and write the figure to `file`."""
    form = warpflat.Mannequin.from_size(BODIES[0]).form("tshirt")
    faces = np.concatenate([piece.grid_vertices[piece.surface.faces] for piece in form.pieces.values()])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tshirt.obj"
        rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in form.vertices.tolist()]
        path.write_text("\n".join([*rows, *("f " + " ".join(str(v + 1) for v in f) for f in faces.tolist()), ""]))
        job = read_job(path, units="m", body=BODIES[0])
        with drawn_page(file, 11.0, 3.9, dpi=110) as pen:
            for number, body in enumerate(BODIES):
                carried = job.to(body, {})
                wearer = Body(vertices=carried.skin, faces=carried.skin_faces)
                # The form has vertices beyond the shirt.
                room = carried.vertices[np.unique(faces[faces >= 0])]
                points, facets, skin = dress(wearer, carried.vertices, faces.astype(np.int32), room)
                view = View.from_side(points, facets, 0.0)
                view.points[: len(carried.vertices), 2] += NEARER
                shades = np.concatenate([np.tile(CLOTH, (len(faces), 1)), skin])
                middle = pen.width * (number + 0.5) / len(BODIES)
                title = f"{body}{' (made for)' if number == 0 else ''}"
                left = middle - 0.5 * SCALE * float(view.size[0])
                draw_row(pen, {title: view}, [shades], left=left, bottom=0.3, inches_per_metre=SCALE, gap=0.0)
                ease = ", ".join(f"{level} {1e3 * (a - b):+.0f}" for level, (a, b) in carried.after.items())
                pen.write(middle, 0.14, f"ease [mm]: {ease}", 8, ha="center")
                print(carried.verdict())


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(Path(__file__).with_name("fit.png")))
