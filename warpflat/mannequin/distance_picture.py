"""A picture of how far a mannequin lies from the scan that it was made on."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.output import atomic_path
from warpflat.export.letters import all_letters
from warpflat.mannequin.closest import Closest
from warpflat.mannequin.normals import face_normals
from warpflat.mannequin.picture import turned_view

if TYPE_CHECKING:
    from warpflat.mannequin.mannequin import Mannequin

__all__ = ["signed_distances", "write_distance_picture"]

_VIEWS = (("front", 0.0), ("left side", 90.0), ("back", 180.0))
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
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    distance = 1000.0 * signed_distances(mannequin)
    scale = ScalarMappable(Normalize(-_SCALE, _SCALE), matplotlib.colormaps["RdBu"])
    faces, span = mannequin.layout.body_faces, float(np.ptp(mannequin.vertices[:, 1]))
    views = [(title, turned_view(mannequin.vertices, angle)) for title, angle in _VIEWS]
    widths = [2.1 * float(np.abs(v[:, 0]).max()) for _, v in views]
    inches = _HEIGHT * 0.84 / (1.02 * span)
    page = sum(widths) * inches
    figure = Figure(figsize=(page, _HEIGHT), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    left = 0.0
    for (title, turned), width in zip(views, widths, strict=True):
        axes = figure.add_axes((left, 0.10, width * inches / page, 0.84))
        left += width * inches / page
        axes.set_axis_off()
        normals = face_normals(turned, faces)
        shade = 0.72 + 0.28 * np.clip(normals[:, 2], 0.0, 1.0)
        colour = scale.to_rgba(distance)[:, :3] * shade[:, None]
        colour[normals[:, 2] < 0.0] = 0.45
        order = np.argsort(turned[faces][:, :, 2].mean(axis=1))
        corners = list(turned[faces[order]][:, :, :2])
        axes.add_collection(PolyCollection(corners, facecolors=colour[order], edgecolors=colour[order], linewidths=0.4))
        axes.set_xlim(-0.5 * width, 0.5 * width)
        axes.set_ylim(turned[:, 1].min() - 0.01 * span, turned[:, 1].max() + 0.01 * span)
        axes.set_aspect("equal")
        axes.set_title(title, fontsize=10)
    bar = figure.colorbar(
        scale, cax=figure.add_axes((0.25, 0.055, 0.5, 0.018)), orientation="horizontal", extend="both"
    )
    far = np.abs(distance)
    bar.set_label(
        f"mannequin inside (-) or outside (+) the scan [mm]; half of it within {np.median(far):.1f} mm, 95 % within "
        f"{np.quantile(far, 0.95):.1f} mm", fontsize=9,
    )  # fmt: skip
    figure.text(0.5, 0.985, f"Distance to the {mannequin.source}", ha="center", va="top", fontsize=11)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})
