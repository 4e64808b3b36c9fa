"""From a flat mesh to a piece: its border is split into named edges, its cracks become darts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Set
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, InputError, IntArray, nearest, optional_step
from warpflat.flat import MEET, border_loops, parted
from warpflat.pattern.drafting.corners import find_corners, find_cracks
from warpflat.pattern.drafting.piece_parts import LEFT_OUT, Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Piece, check_hole
from warpflat.pattern.drafting.placement import default_grain

__all__ = ["MeshFeatures", "inner_stretches", "line_labels", "piece_from_mesh"]


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
    features = features or MeshFeatures()
    flat = np.asarray(positions, dtype=np.float64)
    if flat.ndim != 2 or flat.shape[1] != 2 or not np.isfinite(flat).all():
        raise InputError(f"piece {name!r}: positions have shape {flat.shape}; they must be #V by 2, finite, in metres")
    lines = {key: np.asarray(value, dtype=np.int32) for key, value in features.lines.items()}
    loops = border_loops(faces, np.column_stack([flat, np.zeros(len(flat))]))
    if not loops:
        raise InputError(f"piece {name!r}: the mesh is closed and has no border; cut it open first")
    # Areas [m2], negative where a border runs clockwise.
    plane = flat[:, 0] + 1j * flat[:, 1]
    areas = [float((plane[loop].conj() * plane[np.roll(loop, -1)]).imag.sum() / 2) for loop in loops]
    largest = int(np.argmax(np.abs(areas)))
    if areas[largest] < 0:  # it lies on its back
        flat = flat * [-1.0, 1.0]
    outer, inner = loops[largest], [loop for i, loop in enumerate(loops) if i != largest]
    # A hole that meets the border at a point opens there.
    flat = flat.copy()
    flat[outer] = parted(flat[outer])
    labels = line_labels(outer, lines)
    corners = find_corners(flat[outer])
    # The places in the loop of each dart's left mouth, tip and right mouth; cracks that are found are darts, too.
    where = {vertex: place for place, vertex in enumerate(outer.tolist())}
    darts = {}
    for key, dart in features.darts.items():
        for vertex in dart:
            if vertex not in where:
                raise InputError(f"piece {name!r}: dart {key!r}: vertex {vertex} is not on the outer border")
        left, tip, right = (where[vertex] for vertex in dart)
        if (tip - left) % len(outer) >= (right - left) % len(outer):
            raise InputError(
                f"piece {name!r}: dart {key!r}: give its vertices counter-clockwise: left mouth, tip, right mouth"
            )
        darts[key] = (left, tip, right)
    corners = corners | {place for places in darts.values() for place in places}
    found = find_cracks(flat[outer], corners, {places[1] for places in darts.values()})
    if features.worn is not None:
        mouths = features.worn[outer[[[left, right] for left, _, right in found]]] if found else np.empty((0, 2, 3))
        gap = np.linalg.norm(mouths[:, 1] - mouths[:, 0], axis=1)
        found = [places for places, wide in zip(found, gap.tolist(), strict=True) if wide <= MEET]
    darts |= {(f"dart_{i + 1}" if len(found) > 1 else "dart"): places for i, places in enumerate(found)}
    grain = None
    if (datum := features.grain_line) is not None:
        if datum not in lines:
            raise InputError(f"piece {name!r}: no line {datum!r} for the grain; {nearest(datum, lines)}")
        span = flat[lines[datum][-1]] - flat[lines[datum][0]]
        if (length := float(np.linalg.norm(span))) < 1e-6:
            raise InputError(f"piece {name!r}: line {datum!r} is closed and gives the grain no direction")
        # Parallel to the line's chord but inside the piece: a datum line is often its border.
        x, y = span / length
        turn = np.array([[y, -x], [x, y]])
        grain = default_grain(flat[outer] @ turn.T) @ turn
    changes = {i for i in range(len(labels)) if labels[i] != labels[i - 1]}
    changes |= {where[vertex] for vertex in features.ends if vertex in where}
    # Places strictly between the two mouths of a dart.
    inside_leg = {
        (left + k) % len(labels) for left, _, right in darts.values() for k in range(1, (right - left) % len(labels))
    }
    # The border as edges from one split to the next, named by lines, darts or numbers.
    splits = sorted((corners | changes) - inside_leg | {places[1] for places in darts.values()}) or [0]
    legs = {places[0]: f"{key}.left" for key, places in darts.items()}
    legs |= {places[1]: f"{key}.right" for key, places in darts.items()}
    count, used, plain = len(outer), dict[str, int](), 0
    stretches: list[tuple[str, IntArray]] = []
    for start, end in zip(splits, [*splits[1:], splits[0] + count], strict=True):
        vertices = outer[np.arange(start, end + 1) % count]
        title = legs.get(start, labels[start])
        if not title:
            plain += 1
            title = f"edge_{plain}"
        used[title] = used.get(title, 0) + 1
        stretches.append((title if used[title] == 1 else f"{title}_{used[title]}", vertices))
    names = [title for title, _ in stretches]
    for what, mapping in (("kinds", features.kinds), ("allowances", features.allowances)):
        for key in mapping:
            if key not in names:
                raise InputError(f"piece {name!r}: {what} name an edge {key!r} that it has not; {nearest(key, names)}")
    # Stretches of feature lines inside, and borders inside, counter-clockwise: those of cracks by their names.
    border = {
        (min(a, b), max(a, b)) for loop in loops for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
    }
    internal: dict[str, FloatArray] = {}
    for key, line in lines.items():
        for index, stretch in enumerate(inner_stretches(line, border)):
            internal[key if index == 0 else f"{key}_{index + 1}"] = flat[stretch]
    cracks = {key: np.unique(np.asarray(vertices)) for key, vertices in features.fisheyes.items()}
    holes = []
    for number, loop in enumerate(inner, start=1):
        crack = next((each for each, ids in cracks.items() if np.array_equal(ids, np.sort(loop))), None)
        label, kind = (f"hole_{number}", "cutout") if crack is None else (crack, "dart")
        hole = Hole(name=label, points=flat[loop[::-1]], kind=kind)
        if kind == "cutout":
            with optional_step(f"{label} of {name} is not cut, and drawn dashed") as left_out:
                check_hole(f"piece {name!r}", hole)
            if left_out:
                internal[label + LEFT_OUT] = flat[np.append(loop, loop[0])]
                continue
        holes.append(hole)
    return Piece(
        name=name,
        size=size,
        fabric=fabric,
        edges=[
            Edge(
                name=title,
                points=flat[vertices],
                kind="dart" if title in legs.values() else features.kinds.get(title, "seam"),
                allowance=features.allowances.get(title),
                vertices=vertices,
            )
            for title, vertices in stretches
        ],
        darts=[Dart(name=key, left=f"{key}.left", right=f"{key}.right") for key in darts],
        internal_lines=internal,
        grain=grain,
        holes=holes,
    )


def line_labels(loop: IntArray, curves: Mapping[str, IntArray]) -> list[str]:
    """Return for each border edge, from loop[i] to loop[i + 1], the feature line along it, or ""."""
    label: dict[tuple[int, int], str] = {}
    for key, curve in curves.items():
        for a, b in zip(curve[:-1].tolist(), curve[1:].tolist(), strict=True):
            label.setdefault((min(a, b), max(a, b)), key)
    around = [*loop.tolist(), int(loop[0])]
    return [label.get((min(a, b), max(a, b)), "") for a, b in pairwise(around)]


def inner_stretches(line: IntArray, border: Set[tuple[int, int]]) -> list[IntArray]:
    """Return the stretches of a line, as vertex indices, that do not run along a border.

    Args:
        line: vertex indices.
        border: edges of the border, each as (lower, higher) vertex.
    """
    runs: list[list[int]] = [[]]
    for a, b in pairwise(line.tolist()):
        if (min(a, b), max(a, b)) in border:
            runs.append([])
        else:
            runs[-1] += [b] if runs[-1] else [a, b]
    return [np.array(run, dtype=np.int64) for run in runs if run]
