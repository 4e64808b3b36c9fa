"""Pictures of a mannequin: from four sides, its profiles and lines labelled; and how far it lies from the scan it was made on."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.layout import LEG_LINES, TRUNK_RINGS
from warpflat.pattern import (
    INK,
    SIDES,
    SKIN,
    Facets,
    Scale,
    View,
    draw_row,
    drawn_page,
    row_size,
    space_out,
    write_maps,
)

if TYPE_CHECKING:
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["LINE", "signed_distances", "write_distance_picture", "write_mannequin_picture"]

# The side comes last: its names stand beyond it.
_VIEWS = (("front", 0.0), ("three-quarter", 38.0), ("back", 180.0), ("left side", 90.0))
_HEIGHT, _GAP, _NAMES = 8.0, 0.2, 1.8  # of the page, between views, and room for names [in]
#: Colour of lines on bodies.
LINE = "#9c1f30"
_LEADER = (*INK, 0.65)
# Names of vertical lines are written along them where they are seen best, at a share of their length from below; shoulder and armhole are
# named beside them: at a share of their length, by a leader that rises by a share of the view's height.
_ALONG: Mapping[str, Mapping[str, float]] = {
    "front": {"centre front": 0.06, "crease front right": 0.45, "crease front left": 0.45},
    "three-quarter": {"outseam left": 0.45},
    "back": {"centre back": 0.06, "crease back left": 0.45, "crease back right": 0.45},
}
_BESIDE = {"three-quarter": (("shoulder left", 0.6, 0.06), ("armhole left", 0.28, 0.075))}
# A line is not drawn where it turns from the eye: there it slips along the outline.
_FACING = 0.12
# Ends of the scale of distances [mm]; what lies farther has the colour of the ends.
_SCALE = 15.0


def _body_views(mannequin: Mannequin, sides: Iterable[tuple[str, float]]) -> dict[str, View]:
    """Return views of a mannequin without its mesh by title, from some sides [degrees]."""
    facets = Facets.of(mannequin.layout.body_faces, np.empty((0, 2), dtype=np.int32))
    return View.around(mannequin.vertices, facets, sides)


def write_mannequin_picture(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Draw the mannequin from front, three-quarter, side and back, with profiles and lines by name and girth in cm.

    Raises:
        InputError: if the file cannot be written.
    """
    faces, views = mannequin.layout.body_faces, _body_views(mannequin, _VIEWS)
    wide, high = row_size(views)
    scale = 0.87 * _HEIGHT / high
    with drawn_page(path, scale * wide + _GAP * len(views) + _NAMES, _HEIGHT) as pen:
        skins = [np.tile(SKIN, (len(faces), 1))] * len(views)
        row = draw_row(pen, views, skins, left=0.5 * _GAP, bottom=0.22, inches_per_metre=scale, gap=_GAP)
        for title, drawn in zip(views, row, strict=True):
            towards = vertex_normals(drawn.view.points, faces)[:, 2] > _FACING
            for ids in mannequin.layout.body_lines.values():
                edges = np.column_stack([ids[:-1], ids[1:]])
                drawn.draw_segments(edges[towards[edges].all(axis=1)], width=0.9, colour=LINE)
            for name, share in _ALONG.get(title, {}).items():
                line = drawn.to_page(drawn.view.points[mannequin.layout.body_lines[name]])
                line = line if line[0, 1] < line[-1, 1] else line[::-1]
                at = int(share * (len(line) - 1))
                (x, y), (rise_x, rise_y) = line[at].tolist(), (line[at + 2] - line[at]).tolist()
                angle = float(np.degrees(np.arctan2(rise_y, rise_x)))
                pen.write(x - 0.03, y, name, 8, color=LINE, rotation=angle, rotation_mode="anchor", va="bottom")
            for name, share, rise in _BESIDE.get(title, ()):
                ids = mannequin.layout.lines[name]
                start: FloatArray = drawn.to_page(drawn.view.points[ids[[int(share * (len(ids) - 1))]]])[0]
                x, y = (start + np.array([0.10, rise]) * (drawn.box[3] - drawn.box[1])).tolist()
                pen.line(np.array([start, (x - 0.03, y)]), width=0.5, colour=_LEADER)
                pen.write(x, y, name.removesuffix(" left"), 8)
        # Names and girths [cm] of the profiles stand behind the side view, on short leaders, spread so that none overlap.
        levels, (_, bottom, right, top) = mannequin.levels(), drawn.box
        names = ["neck", "chest back", *reversed(TRUNK_RINGS), *(f"{line} left" for line in LEG_LINES.values())]
        lines = [drawn.to_page(drawn.view.points[mannequin.layout.lines[name]]) for name in names]
        ends = [line[int(np.argmax(line[:, 0]))] for line in lines]
        places = space_out([float(end[1]) for end in ends], 0.028 * (top - bottom), bottom, top)
        for name, end, y in zip(names, ends, places, strict=True):
            shown = {"neck": "neck base", "chest back": "across back"}.get(name, name)
            pen.line(np.array([(end[0] + 0.03, end[1]), (right + 0.44, y)]), width=0.5, colour=_LEADER)
            pen.write(right + 0.5, y, f"{shown} {levels[name].girth * 100:.1f} cm", 8)
        pen.write(0.5 * pen.width, 0.98 * _HEIGHT, f"Mannequin: {mannequin.source}", 12, ha="center")


def signed_distances(mannequin: Mannequin) -> FloatArray:
    """Return how far the middle of each face of the body lies outside the scan [m], negative inside.

    Below the crotch the scan is taken with its legs moved together, as the mannequin has them.

    Args:
        mannequin: one that was made on a scan.
    """
    assert mannequin.scan is not None
    points, triangles = mannequin.scan
    middles = mannequin.vertices[mannequin.layout.body_faces].mean(axis=1)
    surface = Mesh(points, triangles)
    triangle, weights, place = surface.closest(middles)
    off = np.einsum("nd,nd->n", middles - place, surface.normals_at(triangle, weights))
    return np.asarray(np.linalg.norm(middles - place, axis=1) * np.sign(off))


def write_distance_picture(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Draw the mannequin from front, side and back in the colours of its distance to the scan, with a scale in mm.

    Raises:
        InputError: if the file cannot be written.
    """
    distance = 1000.0 * signed_distances(mannequin)
    scale, far = Scale(low=-_SCALE, high=_SCALE, colours="RdBu"), np.abs(distance)
    near = f"half of it within {np.median(far):.1f} mm, 95 % within {np.quantile(far, 0.95):.1f} mm"
    map_of = {f"mannequin inside (-) or outside (+) the scan [mm]; {near}": (scale, [scale.rgb(distance)] * len(SIDES))}
    write_maps(path, f"Distance to the {mannequin.source}", _body_views(mannequin, SIDES), map_of, tallest=_HEIGHT)
