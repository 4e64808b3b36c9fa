"""A picture of the mannequin from four sides, its profiles and lines labelled."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.output import atomic_path
from warpflat.export.letters import all_letters
from warpflat.mannequin.layout import LEG_LINES, RING_LEVELS
from warpflat.mannequin.normals import face_normals, vertex_normals

if TYPE_CHECKING:
    from warpflat.mannequin.mannequin import Mannequin

__all__ = ["turned_view", "write_mannequin_picture"]

_VIEWS = (("front", 0.0), ("three-quarter", 38.0), ("left side", 90.0), ("back", 180.0))
_LIGHT = np.array([-0.35, 0.45, 0.82]) / np.linalg.norm([-0.35, 0.45, 0.82])
_HEIGHT = 8.0
# Cells of the depth picture, and how far before a line something hides it [m].
_CELL, _BEFORE = 0.006, 0.012
# Shorter runs of a line are not drawn [m].
_SHORT = 0.045
_LINE, _INK = "#9c1f30", "#333333"


@all_letters()
def write_mannequin_picture(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Draw the mannequin from front, three-quarter, side and back, with profiles and lines by name and girth in cm.

    Raises:
        InputError: if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    low, high = float(mannequin.vertices[:, 1].min()), float(mannequin.vertices[:, 1].max())
    span = high - low
    views = [(title, turned_view(mannequin.vertices, angle)) for title, angle in _VIEWS]
    # The side view keeps room for the profiles' names behind it.
    widths = [0.62 * span if title == "left side" else 2.06 * float(np.abs(v[:, 0]).max()) for title, v in views]
    inches = _HEIGHT * 0.92 / (1.06 * span)
    page = sum(widths) * inches
    figure = Figure(figsize=(page, _HEIGHT), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    left = 0.0
    for (title, turned), width in zip(views, widths, strict=True):
        axes = figure.add_axes((left, 0.01, width * inches / page, 0.92))
        left += width * inches / page
        axes.set_axis_off()
        _draw_body(axes, turned, mannequin)
        _draw_lines(axes, turned, mannequin)
        if title == "left side":
            _label_levels(axes, turned, mannequin)
        else:
            _label_lines(axes, turned, mannequin, title)
        middle = 0.11 * span if title == "left side" else 0.0
        axes.set_xlim(middle - 0.5 * width, middle + 0.5 * width)
        axes.set_ylim(low - 0.02 * span, high + 0.04 * span)
        axes.set_aspect("equal")
        axes.text(0.0, high + 0.02 * span, title, ha="center", va="bottom", fontsize=11, color=_INK)
    figure.text(0.5, 0.985, f"Mannequin: {mannequin.source}", ha="center", va="top", fontsize=12, color=_INK)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def turned_view(vertices: FloatArray, degrees: float) -> FloatArray:
    """Return vertices seen by somebody who walked `degrees` around the body to its left; x right, y up, z to the eye."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x, y, z = vertices.T
    turned = np.column_stack([c * x - s * z, y, s * x + c * z])
    turned[:, 0] -= 0.5 * (turned[:, 0].min() + turned[:, 0].max())
    return turned


def _draw_body(axes: Any, turned: FloatArray, mannequin: Mannequin) -> None:
    from matplotlib.collections import PolyCollection

    faces = mannequin.layout.body_faces
    normals = face_normals(turned, faces)
    light = 0.36 + 0.60 * np.clip(normals @ _LIGHT, 0.0, 1.0)
    colour = np.clip(np.outer(light, [1.0, 0.965, 0.90]), 0.0, 1.0)
    # Inside of neck and sleeves: darker, so that openings read as openings.
    inside = normals[:, 2] < 0.0
    colour[inside] = [0.42, 0.38, 0.36]
    order = np.argsort(turned[faces][:, :, 2].mean(axis=1))
    axes.add_collection(
        PolyCollection(
            list(turned[faces[order]][:, :, :2]), facecolors=colour[order], edgecolors=colour[order], linewidths=0.4
        )
    )


def _visible(turned: FloatArray, mannequin: Mannequin, ids: Any, nearest: FloatArray) -> Any:
    """Return which vertices of a line face the viewer with nothing of the body before them."""
    normals = vertex_normals(turned, mannequin.layout.body_faces)
    cell = _cells(turned[ids], turned)
    seen = (normals[ids, 2] > 0.12) & (turned[ids, 2] > nearest[cell[:, 0], cell[:, 1]] - _BEFORE)
    # What is left of a line that slips along the outline is no more than stray marks.
    ends = np.flatnonzero(np.diff(np.r_[False, seen, False].astype(int))).reshape(-1, 2)
    for first, last in ends[np.diff(ends).ravel() * mannequin.layout.resolution < _SHORT]:
        seen[first:last] = False
    return seen


def _nearest(turned: FloatArray, mannequin: Mannequin) -> FloatArray:
    """Return the body's depth [m] nearest to the viewer in each cell of the picture."""
    corners = turned[mannequin.layout.body_faces]
    steps = np.linspace(0.0, 1.0, 5)
    u, v = (a.ravel()[:, None, None] for a in np.meshgrid(steps, steps))
    spots = (1 - u) * ((1 - v) * corners[:, 0] + v * corners[:, 3]) + u * ((1 - v) * corners[:, 1] + v * corners[:, 2])
    spots = spots.reshape(-1, 3)
    cell = _cells(spots, turned)
    depth = np.full(cell.max(axis=0) + 1, -np.inf)
    np.maximum.at(depth, (cell[:, 0], cell[:, 1]), spots[:, 2])
    return depth


def _cells(points: FloatArray, turned: FloatArray) -> Any:
    return ((points[:, :2] - turned[:, :2].min(axis=0)) / _CELL).astype(int)


def _draw_lines(axes: Any, turned: FloatArray, mannequin: Mannequin) -> None:
    from matplotlib.collections import LineCollection

    segments = []
    nearest = _nearest(turned, mannequin)
    for ids in mannequin.layout.body_lines.values():
        seen = _visible(turned, mannequin, ids, nearest)
        both = seen[:-1] & seen[1:]
        segments.append(np.stack([turned[ids[:-1]], turned[ids[1:]]], 1)[both][:, :, :2])
    axes.add_collection(LineCollection(list(np.concatenate(segments)), colors=_LINE, linewidths=0.9))


def _label_levels(axes: Any, turned: FloatArray, mannequin: Mannequin) -> None:
    """Return names and girths [cm] of the profiles behind the side view, on short leaders, spread so that none overlap."""
    levels = mannequin.levels()
    trunk = RING_LEVELS[RING_LEVELS.index("hip") :]
    names = ["neck", "chest back", *reversed(trunk), *(f"{line} left" for line in LEG_LINES.values())]
    span = float(np.ptp(turned[:, 1]))
    anchors = [turned[ids][int(np.argmax(turned[ids][:, 0]))] for ids in (mannequin.layout.lines[n] for n in names)]
    places = _spread(np.array([a[1] for a in anchors]), 0.028 * span)
    x = 0.17 * span
    for name, anchor, y in zip(names, anchors, places, strict=True):
        words = {"neck": "neck base", "chest back": "across back"}.get(name, name)
        axes.plot([anchor[0] + 0.006, x - 0.008 * span], [anchor[1], y], color=_INK, linewidth=0.5, alpha=0.6)
        axes.text(x, y, f"{words} {levels[name].girth * 100:.1f} cm", fontsize=8, va="center", ha="left", color=_INK)


def _spread(wished: FloatArray, gap: float) -> FloatArray:
    """Return heights near the wished ones (high to low), at least `gap` apart."""
    places = wished.copy()
    for i in range(1, len(places)):
        places[i] = min(places[i], places[i - 1] - gap)
    return places


def _label_lines(axes: Any, turned: FloatArray, mannequin: Mannequin, view: str) -> None:
    """Return names of the vertical lines, written along them where they are seen best, and of shoulder and armhole."""
    places = {
        "front": {"centre front": 0.06, "crease front right": 0.45, "crease front left": 0.45},
        "three-quarter": {"outseam left": 0.45},
        "back": {"centre back": 0.06, "crease back left": 0.45, "crease back right": 0.45},
    }[view]
    for name, share in places.items():
        ids = mannequin.layout.body_lines[name]
        ids = ids if turned[ids[0], 1] < turned[ids[-1], 1] else ids[::-1]
        row = int(share * (len(ids) - 1))
        point, above = turned[ids[row]], turned[ids[row + 2]]
        tilt = np.degrees(np.arctan2(above[1] - point[1], above[0] - point[0]))
        axes.text(
            point[0] - 0.006, point[1], name, fontsize=8, color=_LINE, rotation=tilt, rotation_mode="anchor", ha="left",
            va="bottom",
        )  # fmt: skip
    if view != "three-quarter":
        return
    span = float(np.ptp(turned[:, 1]))
    for name, words, share in (("shoulder left", "shoulder", 0.6), ("armhole left", "armhole", 0.28)):
        ids = mannequin.layout.lines[name]
        point = turned[ids[int(share * (len(ids) - 1))]]
        at = (point[0] + 0.10 * span, point[1] + 0.06 * span if words == "shoulder" else point[1] + 0.075 * span)
        axes.plot([point[0], at[0] - 0.004 * span], [point[1], at[1]], color=_INK, linewidth=0.5, alpha=0.7)
        axes.text(at[0], at[1], words, fontsize=8, color=_INK, va="center", ha="left")
