"""From a flat mesh to a piece: its border is split into named edges, its cracks become darts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, InputError, IntArray, nearest
from warpflat.flat import OVERLAP, border_loops
from warpflat.pattern.drafting.corners import find_corners, find_cracks
from warpflat.pattern.drafting.piece_parts import LEFT_OUT, SAME_POINT, Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Piece, check_hole
from warpflat.pattern.drafting.placement import default_grain
from warpflat.pattern.drafting.polygons import signed_area, upright
from warpflat.pattern.files.output import optional_step

__all__ = ["BORDERS_MEET", "MeshFeatures", "line_labels", "piece_from_mesh", "runs_without"]

#: Borders that run along each other within this distance [m] are meant to meet.
BORDERS_MEET = 1e-3

#: Places in a border of a dart's left mouth, tip and right mouth, in counter-clockwise order.
DartPlaces = tuple[int, int, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFeatures:
    """Features of a flat mesh: lines, kinds of edges, darts, grain.

    Attributes:
        lines: feature lines by name, vertex indices along mesh edges.
        kinds: kind by edge name ("fold", "hem", "cut"); edges that are not named are seams.
        allowances: allowance [m] by edge name.
        darts: by name, the vertices (left mouth, tip, right mouth) in border order, counter-clockwise. Other cracks are
            found where the border turns back sharply between two equally long legs that end in corners.
        fisheyes: by name, the vertices on both sides of a crack inside: a fish-eye dart. Other border loops inside are
            cutouts.
        ends: vertices of the border at which edges end, beside its corners.
        worn: #V by 3 [m], where the piece lies in space, sewn to others: a crack that gapes there is a vent, no dart. None
            elsewhere, as of a flat panel, whose darts gape.
        grain_line: the feature line whose direction, from its first vertex to its last, is the grain; None takes y.
    """

    lines: Mapping[str, ArrayLike] = field(default_factory=dict)
    kinds: Mapping[str, str] = field(default_factory=dict)
    allowances: Mapping[str, float] = field(default_factory=dict)
    darts: Mapping[str, DartPlaces] = field(default_factory=dict)
    fisheyes: Mapping[str, ArrayLike] = field(default_factory=dict)
    ends: Collection[int] = ()
    worn: FloatArray | None = None
    grain_line: str | None = None


def piece_from_mesh(
    faces: IntArray,
    positions: ArrayLike,
    *,
    name: str,
    features: MeshFeatures | None = None,
    size: str = "",
    fabric: str = "",
) -> Piece:
    """Make a piece of a flat mesh.

    The border is split at its corners, at the ends of darts and wherever a feature line begins or ends to run along
    it. An edge is named by the line along it ("side"; a second stretch is "side_2"), others "edge_1", "edge_2" ...;
    the legs of a dart "NAME.left" and "NAME.right". Border loops inside become cutouts and fish-eye darts, feature
    lines inside internal lines.

    Args:
        faces: #F by 4, -1 in the last column of a triangle, consistently wound.
        positions: #V by 2 [m]; a layout that lies on its back (negative area) is turned over.
        name: of the piece.
        features: lines, darts and edges that are known.
        size, fabric: as in :class:`Piece`.

    Raises:
        InputError: unknown names, a mesh without a border, dart vertices that are not on it, a border that crosses
            itself, or a crack around which the cloth lies on itself.
    """
    features, where = features or MeshFeatures(), f"piece {name!r}"
    flat = np.asarray(positions, dtype=np.float64)
    if flat.ndim != 2 or flat.shape[1] != 2 or not np.isfinite(flat).all():
        raise InputError(f"{where}: positions have shape {flat.shape}; they must be #V by 2, finite, in metres")
    lines = {key: np.asarray(value, dtype=np.int32) for key, value in features.lines.items()}
    loops = border_loops(faces, np.column_stack([flat, np.zeros(len(flat))]))
    if not loops:
        raise InputError(f"{where}: the mesh is closed and has no border; cut it open first")
    areas = [signed_area(flat[loop]) for loop in loops]
    largest = int(np.argmax(np.abs(areas)))
    if areas[largest] < 0:  # it lies on its back
        flat = flat * [-1.0, 1.0]
    outer, inner = loops[largest], [loop for i, loop in enumerate(loops) if i != largest]
    # A hole that meets the border at a point opens there.
    flat = flat.copy()
    flat[outer] = _parted(flat[outer])
    corners, darts = _find_darts(flat, outer, features, where)
    stretches = _split_border(outer, line_labels(outer, lines), corners, darts, features.ends)
    names = [title for title, _ in stretches]
    for what, mapping in (("kinds", features.kinds), ("allowances", features.allowances)):
        for key in mapping:
            if key not in names:
                raise InputError(f"{where}: {what} name an edge {key!r} that it has not; {nearest(key, names)}")
    legs = {f"{key}.{side}" for key in darts for side in ("left", "right")}
    border = {
        (min(a, b), max(a, b)) for loop in loops for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
    }
    internal = {
        key if index == 0 else f"{key}_{index + 1}": flat[stretch]
        for key, line in lines.items()
        for index, stretch in enumerate(runs_without(line, border))
    }
    holes, left_out = _holes(flat, inner, features.fisheyes, name)
    grain = None
    if (datum := features.grain_line) is not None:
        if datum not in lines:
            raise InputError(f"{where}: no line {datum!r} for the grain; {nearest(datum, lines)}")
        span = flat[lines[datum][-1]] - flat[lines[datum][0]]
        if float(np.linalg.norm(span)) < SAME_POINT:
            raise InputError(f"{where}: line {datum!r} is closed and gives the grain no direction")
        # Parallel to the line's chord but inside the piece: a datum line is often its border.
        grain = default_grain(flat[outer] @ upright(span).T) @ upright(span)
    return Piece(
        name=name,
        size=size,
        fabric=fabric,
        edges=[
            Edge(
                name=title,
                points=flat[vertices],
                kind="dart" if title in legs else features.kinds.get(title, "seam"),
                allowance=features.allowances.get(title),
                vertices=vertices,
            )
            for title, vertices in stretches
        ],
        darts=[Dart(name=key, left=f"{key}.left", right=f"{key}.right") for key in darts],
        internal_lines=internal | left_out,
        grain=grain,
        holes=holes,
    )


def _find_darts(
    flat: FloatArray, outer: IntArray, features: MeshFeatures, where: str
) -> tuple[set[int], dict[str, DartPlaces]]:
    """Return the places of corners in the border, and those of darts: of the given ones, and of cracks, which are darts, too."""
    place = {vertex: k for k, vertex in enumerate(outer.tolist())}
    darts: dict[str, DartPlaces] = {}
    for key, dart in features.darts.items():
        for vertex in dart:
            if vertex not in place:
                raise InputError(f"{where}: dart {key!r}: vertex {vertex} is not on the outer border")
        left, tip, right = (place[vertex] for vertex in dart)
        if (tip - left) % len(outer) >= (right - left) % len(outer):
            raise InputError(
                f"{where}: dart {key!r}: give its vertices counter-clockwise: left mouth, tip, right mouth"
            )
        darts[key] = left, tip, right
    corners = find_corners(flat[outer]) | {place for places in darts.values() for place in places}
    found = find_cracks(flat[outer], corners, {tip for _, tip, _ in darts.values()})
    if (worn := features.worn) is not None:
        found = [each for each in found if np.linalg.norm(worn[outer[each[2]]] - worn[outer[each[0]]]) <= BORDERS_MEET]
    return corners, darts | {(f"dart_{i + 1}" if len(found) > 1 else "dart"): each for i, each in enumerate(found)}


def _split_border(
    outer: IntArray,
    labels: Sequence[str],
    corners: set[int],
    darts: Mapping[str, DartPlaces],
    ends: Collection[int],
) -> list[tuple[str, IntArray]]:
    """Return the border as edges from one split to the next: the vertices of each, named by lines, darts or numbers."""
    count = len(outer)
    splits = corners | {k for k in range(count) if labels[k] != labels[k - 1]}
    splits |= set(np.flatnonzero(np.isin(outer, list(ends))).tolist())
    # Strictly between the two mouths of a dart there is its tip alone.
    splits -= {(left + k) % count for left, _, right in darts.values() for k in range(1, (right - left) % count)}
    splits |= {tip for _, tip, _ in darts.values()}
    legs = {left: f"{key}.left" for key, (left, _, _) in darts.items()}
    legs |= {tip: f"{key}.right" for key, (_, tip, _) in darts.items()}
    ordered, used, plain = sorted(splits) or [0], dict[str, int](), 0
    stretches = []
    for start, end in zip(ordered, [*ordered[1:], ordered[0] + count], strict=True):
        title = legs.get(start, labels[start])
        if not title:
            plain += 1
            title = f"edge_{plain}"
        used[title] = used.get(title, 0) + 1
        name = title if used[title] == 1 else f"{title}_{used[title]}"
        stretches.append((name, outer[np.arange(start, end + 1) % count]))
    return stretches


def _holes(
    flat: FloatArray, loops: Sequence[IntArray], fisheyes: Mapping[str, ArrayLike], piece: str
) -> tuple[list[Hole], dict[str, FloatArray]]:
    """Return the holes inside a piece, those of cracks by their names, and the borders of those that cannot be cut."""
    cracks = {key: np.unique(np.asarray(vertices)) for key, vertices in fisheyes.items()}
    holes, borders = [], {}
    for number, loop in enumerate(loops, start=1):
        crack = next((each for each, ids in cracks.items() if np.array_equal(ids, np.sort(loop))), None)
        label, kind = (f"hole_{number}", "cutout") if crack is None else (crack, "dart")
        hole = Hole(name=label, points=flat[loop[::-1]], kind=kind)
        if kind == "cutout":
            with optional_step(f"{label} of {piece} is not cut, and drawn dashed") as left_out:
                check_hole(f"piece {piece!r}", hole)
            if left_out:
                borders[label + LEFT_OUT] = flat[np.append(loop, loop[0])]
                continue
        holes.append(hole)
    return holes, borders


def line_labels(loop: IntArray, curves: Mapping[str, IntArray]) -> list[str]:
    """Return for each border edge, from loop[i] to loop[i + 1], the feature line along it, or ""."""
    label: dict[tuple[int, int], str] = {}
    for key, curve in curves.items():
        for a, b in zip(curve[:-1].tolist(), curve[1:].tolist(), strict=True):
            label.setdefault((min(a, b), max(a, b)), key)
    around = [*loop.tolist(), int(loop[0])]
    return [label.get((min(a, b), max(a, b)), "") for a, b in pairwise(around)]


def runs_without(path: IntArray, edges: Collection[tuple[int, ...]]) -> list[IntArray]:
    """Return the runs of a path, as vertex indices, between the edges of it that are among `edges`, each as (lower, higher) vertex."""
    runs: list[list[int]] = [[]]
    for a, b in pairwise(path.tolist()):
        if (min(a, b), max(a, b)) in edges:
            runs.append([])
        else:
            runs[-1] += [b] if runs[-1] else [a, b]
    return [np.array(run, dtype=np.int32) for run in runs if run]


def _parted(ring: FloatArray) -> FloatArray:
    """Return an outline that touches itself, or lies over itself by rounding, with these places moved apart; any other one as it is.

    Around a hole that meets the border at a point, and where two borders run along each other, points move into the cloth, by a share of
    `OVERLAP`.

    Args:
        ring: #P by 2 [m], closed, the first point not repeated, counter-clockwise.
    """
    import shapely

    if len(ring) < 4 or shapely.Polygon(ring).is_valid:
        return ring
    ahead = np.roll(ring, -1, axis=0)
    sides = shapely.linestrings(np.stack([ring, ahead], axis=1))
    point, side = shapely.STRtree(sides).query(shapely.points(ring), predicate="dwithin", distance=OVERLAP)
    # What lies near along the outline is no other part of it.
    lengths = np.linalg.norm(ahead - ring, axis=1)
    at, around = np.cumsum(lengths) - lengths, float(lengths.sum())
    between = np.minimum(np.abs(at[point] - at[side]), np.abs(at[point] - at[side] - lengths[side]))
    touching = np.unique(point[np.minimum(between, around - between - lengths[side]) > 4.0 * OVERLAP])
    way = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    inward = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]
    for share in (0.05, 0.1, 0.2, 0.4):
        moved = ring.copy()
        moved[touching] += share * OVERLAP * inward[touching]
        if shapely.Polygon(moved).is_valid:
            return moved
    return ring
