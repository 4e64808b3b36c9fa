"""The datum line of a piece: the named one, or a long line through the middle of the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.band import line_along_band
from warpflat.flat.surface.paths.lines import line_between, line_from_indices, line_on_plane
from warpflat.flat.surface.triangles import triangulate
from warpflat.flat.surface.vectors import cross, norm, points_at

__all__ = ["choose_datum", "datum_extent"]

# A datum is level if it leaves its plane by less than this share of its length.
_LEVEL = 1e-6


# A parallel line follows the same section if its ends are as far apart, to this share.
_AS_LONG = 0.05


# A piece is about as wide as long from this ratio of its variances,
_AS_WIDE = 0.64
# and neither axis is a direction of its own from this ratio.
_ALIKE = 0.95


# An axis that leans no more than this from the vertical gives way to it [cosine].
_HANGS = np.cos(np.radians(10.0))


def choose_datum(surface: Surface) -> tuple[IntArray, str]:
    """Return the line along the piece's long axis through its middle, as vertex indices along edges, and a description of it.

    The long axis is the first principal axis of the surface. Where length and width are within a fifth of each other it is the
    one of the two that is nearer to the vertical (+y), and the vertical itself where that leans by no more than 10 degrees from
    it, or where both are so alike that neither tells a direction. The line follows the section by the plane of that axis and
    the mean normal, or a parallel one beside it whose line has its ends far more level. Of a band that this cuts crosswise,
    since it curls, the line runs through the middle from end to end instead.
    """
    triangles, _ = triangulate(surface.faces)
    p = points_at(surface.vertices, triangles.T)
    normal = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    area = norm(normal)
    middle = p.mean(axis=1)
    centre = np.average(middle, axis=1, weights=area)
    # Exact over each triangle, or the axis of a rectangle of quads would lean to the diagonals by which these are split.
    spread = np.zeros((3, 3))
    for points, share in ((p[:, 0], 1.0), (p[:, 1], 1.0), (p[:, 2], 1.0), (middle, 9.0)):
        at = points - centre[:, None]
        spread += share / 12.0 * (at * area) @ at.T
    values, axes = np.linalg.eigh(spread / area.sum())
    facing = normal.sum(axis=1)
    up = np.array([0.0, 1.0, 0.0]) - facing * facing[1] / max(float(facing @ facing), 1e-300)
    size = float(np.linalg.norm(up))
    if values[1] <= _AS_WIDE * values[2] or size <= 0.5:
        long_axis, words = axes[:, 2], "along the long axis through the middle"
    else:
        # Nearly as wide as long: let the grain hang down rather than run by the accident of a few millimetres.
        leaning = np.abs(axes[:, 1:].T @ up) / size
        nearer = int(leaning.argmax())
        if values[1] > _ALIKE * values[2] or leaning.max() > _HANGS:
            long_axis, words = up / size, "upright through the middle, the piece being about as wide as long"
        else:
            long_axis = axes[:, 1 + nearer]
            words = (
                f"along the {('short', 'long')[nearer]} axis through the middle, the more upright of two about as long"
            )
    long_axis = long_axis * _upwards(long_axis, long_axis)
    across = np.cross(long_axis, facing)
    if np.linalg.norm(across) < 1e-9 * max(float(np.linalg.norm(facing)), 1e-300) or not np.any(facing):
        across = axes[:, 1]
    try:
        line = _level_line(surface, centre, across)
    except InputError:
        line = np.empty(0, dtype=np.int32)
    if len(line) < 2 or line[0] == line[-1]:
        along = (surface.vertices - centre) @ long_axis
        line = line_between(surface, int(along.argmin()), int(along.argmax()))
    band = line_along_band(surface, line)
    line, words = (line, words) if band is None else (band, "along the middle of the band, from end to end")
    rising = surface.vertices[line[-1]] - surface.vertices[line[0]]
    upwards = _upwards(rising, long_axis if band is None else rising)
    return np.ascontiguousarray(line if upwards > 0 else line[::-1], dtype=np.int32), words


def _upwards(direction: FloatArray, leading: FloatArray) -> int:
    """Return 1 for a direction that rises along +y (a level one: along the axis nearest to `leading`), else -1."""
    axis = 1 if abs(direction[1]) > 1e-6 * np.linalg.norm(direction) else int(np.abs(leading).argmax())
    return 1 if direction[axis] >= 0 else -1


def _level_line(surface: Surface, point: FloatArray, normal: FloatArray) -> IntArray:
    """Return the line along the section by a plane, or by a parallel one beside it whose line has far more level ends.

    The grain is the chord of the ends, and where the section lies halfway between two columns, each ends on either of them.

    Raises:
        InputError: if the plane misses the piece.
    """
    direction = normal / np.linalg.norm(normal)
    height = (surface.vertices - point) @ direction

    def reach_and_slope(line: IntArray) -> tuple[float, float]:
        reach = float(np.linalg.norm(surface.vertices[line[-1]] - surface.vertices[line[0]]))
        return reach, abs(float(height[line[-1]] - height[line[0]])) / max(reach, 1e-300)

    line = line_on_plane(surface, point, normal)
    reach, slope = reach_and_slope(line) if len(line) else (0.0, 0.0)
    if slope < _LEVEL:
        return line
    edges = half_edges_of(surface).edges
    at_ends = edges[np.isin(edges, line[[0, -1]]).any(axis=1) & (height[edges].prod(axis=1) < 0)]
    shifts = np.unique(np.round(height[np.union1d(at_ends, line[[0, -1]])] / reach, 9)) * reach
    best = (0.5 * slope, 0.0, 0.0), line
    for shift in shifts.tolist():
        try:
            other = line_on_plane(surface, point + shift * direction, normal)
        except InputError:
            continue
        if len(other) < 2:
            continue
        its_reach, its_slope = reach_and_slope(other)
        # Rounded, so that rounding errors do not choose: of two lines as level and as near, the right one is taken.
        key = round(its_slope, 6), round(abs(shift) / reach, 6), -shift
        if abs(its_reach / reach - 1.0) < _AS_LONG and key < best[0]:
            best = key, other
    return best[1]


def resolve_datum(surface: Surface, datum: str | ArrayLike | None) -> tuple[IntArray, str, list[str]]:
    """Return the datum as vertex indices, its name, and a note if it was chosen here."""
    if datum is None:
        report_activity("developing the piece")
        line, along = choose_datum(surface)
        return line, "datum", [f"datum chosen: {along}, {datum_extent(surface, line)}"]
    if isinstance(datum, str):
        if datum not in surface.lines:
            raise InputError(
                f"piece {surface.name!r} has no line {datum!r} for its datum; {nearest(datum, surface.lines)}"
            )
        line, name = np.asarray(surface.lines[datum], dtype=np.int32), datum
    else:
        line, name = line_from_indices(surface, datum), "datum"
    if len(line) < 2:
        raise InputError(f"datum {name!r} of piece {surface.name!r} has {len(line)} vertex; it needs two or more")
    if line[0] == line[-1]:
        raise InputError(f"datum {name!r} of piece {surface.name!r} is closed; it must run from one end to another")
    chord = surface.vertices[line[-1]] - surface.vertices[line[0]]
    # A pattern lies as the piece hangs on the body (+y is up), whichever way its line happens to run.
    downward = chord[1] < -0.1 * float(np.linalg.norm(chord))
    return np.ascontiguousarray(line[::-1] if downward else line), name, []


def datum_extent(surface: Surface, line: IntArray) -> str:
    """Return the length of a datum and its ends, as text; vertices are numbered as they were read."""
    length = polyline_length(surface.vertices[line])
    ends = ", ".join(f"vertex {int(surface.input_index[v])}" for v in (line[0], line[-1]))
    return f"{100 * length:.1f} cm ({ends})"
