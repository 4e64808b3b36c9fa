"""A picture of how far a mannequin lies from the scan that it was made on."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from warpflat.core.arrays import FloatArray
from warpflat.export.figure import Pen, new_figure, write_figure
from warpflat.export.letters import all_letters
from warpflat.export.picture_views import SIDES, DrawnView, make_facets, view_from_side
from warpflat.mannequin.closest import Closest

if TYPE_CHECKING:
    from warpflat.mannequin.mannequin import Mannequin

__all__ = ["signed_distances", "write_distance_picture"]

# Ends of the scale [mm]; what lies farther has the colour of the ends.
_SCALE = 15.0
_HEIGHT = 8.0


def signed_distances(mannequin: Mannequin) -> FloatArray:
    """Return how far the middle of each face of the body lies outside the scan [m], negative inside.

    Below the crotch the scan is taken with its legs moved together, as the mannequin has them.

    Args:
        mannequin: one that was made on a scan.
    """
    assert mannequin.scan is not None
    points, triangles = mannequin.scan
    middles = mannequin.vertices[mannequin.layout.body_faces].mean(axis=1)
    triangle, weights, distance = Closest(points, triangles)(middles)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A mesh whose faces turn inwards has a negative volume.
    turn = np.sign(np.einsum("td,td->", normals, corners.mean(axis=1) - points.mean(axis=0)))
    place = np.einsum("nk,nkd->nd", weights, corners[triangle])
    return np.asarray(distance * np.sign(turn * np.einsum("nd,nd->n", middles - place, normals[triangle])))


@all_letters()
def write_distance_picture(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Draw the mannequin from front, side and back in the colours of its distance to the scan, with a scale in mm.

    Raises:
        InputError: if the file cannot be written.
    """
    faces, distance = mannequin.layout.body_faces, 1000.0 * signed_distances(mannequin)
    scale = ScalarMappable(Normalize(-_SCALE, _SCALE), colormaps["RdBu"])
    facets = make_facets(faces, np.empty((0, 2), dtype=np.int32))
    views = [(title, view_from_side(mannequin.vertices, facets, angle)) for title, angle in SIDES]
    inches = _HEIGHT * 0.82 / float(views[0][1].size[1])
    figure = new_figure(inches * sum(1.05 * float(view.size[0]) for _, view in views), _HEIGHT)
    pen = Pen(figure)
    pen.open_page()
    left, colours = 0.0, scale.to_rgba(distance)[:, :3]
    for title, view in views:
        wide = inches * float(view.size[0])
        drawn = DrawnView(view, left=left + 0.025 * wide, bottom=0.11 * _HEIGHT, inches_per_metre=inches)
        drawn.draw(pen.axes, colours)
        pen.write(left + 0.525 * wide, drawn.box[3] + 0.12, title, 10, ha="center")
        left += 1.05 * wide
    bar = figure.colorbar(
        scale, cax=figure.add_axes((0.25, 0.055, 0.5, 0.018)), orientation="horizontal", extend="both"
    )
    far = np.abs(distance)
    bar.set_label(
        f"mannequin inside (-) or outside (+) the scan [mm]; half of it within {np.median(far):.1f} mm, 95 % within "
        f"{np.quantile(far, 0.95):.1f} mm", fontsize=9,
    )  # fmt: skip
    pen.write(0.5 * pen.page_width, 0.98 * _HEIGHT, f"Distance to the {mannequin.source}", 11, ha="center")
    write_figure(path, figure)
