"""From a flat mesh to a piece: its border walked, split into named edges, its cracks read as darts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IndexArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import segment_lengths
from warpflat.pattern.label import default_grain
from warpflat.pattern.pieces import Dart, Edge, Hole, Piece
from warpflat.surface.connectivity import border_loops

__all__ = ["line_labels", "piece_from_mesh"]


#: A corner is measured over this much border [m] on either side: single steps of a ragged border turn anywhere.
WINDOW = 0.012
#: Over a narrow end, from one corner to another within the window, the border turns by more than this [rad].
END = np.radians(135.0)
#: A border that turns back by more than this [rad] is the tip of a crack: a dart that opens by less than 40 degrees.
TIP = np.radians(140.0)
#: The two legs of a crack are as long as each other, within this share.
LEGS = 0.05


def piece_from_mesh(
    faces: IntArray,
    positions: ArrayLike,
    *,
    name: str,
    lines: Mapping[str, ArrayLike] | None = None,
    kinds: Mapping[str, str] | None = None,
    allowances: Mapping[str, float] | None = None,
    darts: Mapping[str, tuple[int, int, int]] | None = None,
    eyes: Mapping[str, ArrayLike] | None = None,
    grain_line: str | None = None,
    corner_angle: float = np.radians(35.0),
    size: str = "",
    fabric: str = "",
    quantity: int = 1,
    paired: bool = True,
) -> Piece:
    """Make a piece of a flat mesh.

    The border is split at its corners, at the ends of darts and wherever a feature line begins or ends to run along
    it. An edge is named by the line along it ("side"; a second stretch is "side_2"), others "edge_1", "edge_2" ...;
    the legs of a dart "NAME.left" and "NAME.right". Border loops inside become cutouts and fish-eye darts, feature lines
    inside internal lines.

    Args:
        faces: #F by 4, -1 in the last column of a triangle, consistently wound.
        positions: #V by 2 [m]; a layout that lies on its back (negative area) is turned over.
        name: of the piece.
        lines: feature lines by name, vertex indices along mesh edges.
        kinds: kind by edge name ("fold", "hem", "cut"); edges not named are seams.
        allowances: allowance [m] by edge name.
        darts: by name, the vertices (left mouth, tip, right mouth) in border order, counter-clockwise. Other cracks are
            found where the border turns back sharply between two equally long legs that end in corners.
        eyes: by name, the vertices on both sides of a crack inside: a fish-eye dart. Other border loops inside are cutouts.
        grain_line: the feature line whose direction, from its first vertex to its last, is the grain; None takes y.
        corner_angle: [rad], a border vertex that turns by more is a corner.
        size, fabric, quantity, paired: as in :class:`Piece`.

    Raises:
        InputError: unknown names, a mesh without a border, dart vertices that are not on it, a border that crosses
            itself, or a crack or hole around which the cloth lies on itself.
    """
    flat = np.asarray(positions, dtype=np.float64)
    if flat.ndim != 2 or flat.shape[1] != 2 or not np.isfinite(flat).all():
        raise InputError(f"piece {name!r}: positions have shape {flat.shape}; they must be #V by 2, finite, in metres")
    curves = {key: np.asarray(value, dtype=np.int32) for key, value in (lines or {}).items()}
    loops = border_loops(faces, np.column_stack([flat, np.zeros(len(flat))]))
    if not loops:
        raise InputError(f"piece {name!r}: the mesh is closed and has no border; cut it open first")
    areas = [_area(flat[loop]) for loop in loops]
    outer = int(np.argmax(np.abs(areas)))
    if areas[outer] < 0:
        flat = flat * [-1.0, 1.0]
    loop, holes = loops[outer], [hole for i, hole in enumerate(loops) if i != outer]
    labels = line_labels(loop, curves)
    corners = _corners(flat[loop], corner_angle)
    named = _dart_places(loop, darts or {}, name)
    corners |= {place for places in named.values() for place in places}
    found = _cracks(flat[loop], corners, {places[1] for places in named.values()})
    named |= {(f"dart_{i + 1}" if len(found) > 1 else "dart"): places for i, places in enumerate(found)}
    changes = {i for i in range(len(loop)) if labels[i] != labels[i - 1]}
    inside_leg = {place for places in named.values() for place in _between(places, len(loop))}
    splits = sorted((corners | changes) - inside_leg | {p[1] for p in named.values()}) or [0]
    edges = _edges(flat, loop, splits, labels, named, kinds or {}, allowances or {}, name)
    grain = None
    if grain_line is not None:
        if grain_line not in curves:
            raise InputError(f"piece {name!r}: no line {grain_line!r} for the grain; {nearest(grain_line, curves)}")
        grain = _grain(flat, loop, curves[grain_line], grain_line, name)
    return Piece(
        name=name,
        size=size,
        fabric=fabric,
        quantity=quantity,
        paired=paired,
        edges=edges,
        darts=[Dart(name=key, left=f"{key}.left", right=f"{key}.right") for key in named],
        internal_lines=_internal(flat, faces, loops, curves),
        grain=grain,
        holes=_holes(flat, holes, eyes or {}),
    )


def _holes(flat: FloatArray, loops: Sequence[IntArray], eyes: Mapping[str, ArrayLike]) -> list[Hole]:
    """The border loops inside, counter-clockwise: those of cracks by their names, the others numbered."""
    cracks = {name: np.unique(np.asarray(vertices)) for name, vertices in eyes.items()}
    holes = []
    for number, loop in enumerate(loops, start=1):
        eye = next((name for name, crack in cracks.items() if np.array_equal(crack, np.sort(loop))), None)
        name, kind = (f"hole_{number}", "cutout") if eye is None else (eye, "dart")
        holes.append(Hole(name=name, points=flat[loop[::-1]], kind=kind))
    return holes


def _area(ring: FloatArray) -> float:
    following = np.roll(ring, -1, axis=0)
    return float((ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]).sum() / 2)


def _turns(ring: FloatArray) -> FloatArray:
    """#P, by how much [rad] the border turns at each vertex, over the window on either side, but at least a step."""
    walk = _Walk(ring)
    return walk.turns(walk.back(walk.here, walk.window), walk.here, walk.on(walk.here, walk.window))


class _Walk:
    """A closed border, three times round, so that there are places before and after each of those `here`.

    Attributes:
        window: over which a corner is measured [m].
        here: #P, the places of the second round.
        along: the length [m] up to each place.
    """

    def __init__(self, ring: FloatArray) -> None:
        step = segment_lengths(ring, closed=True)
        self.ring, self.count = ring, len(ring)
        self.length = float(step.sum())
        self.window = min(WINDOW, self.length / 24)
        self.here = np.arange(self.count, 2 * self.count)
        self.along = np.concatenate([[0.0], np.cumsum(np.tile(step, 3))])[: 3 * self.count]

    def back(self, places: IndexArray, reach: float | FloatArray) -> IndexArray:
        """The farthest places within `reach` [m] before others, but at least a step."""
        return np.minimum(np.searchsorted(self.along, self.along[places] - reach - 1e-12), places - 1)

    def on(self, places: IndexArray, reach: float | FloatArray) -> IndexArray:
        """Likewise after them."""
        return np.maximum(np.searchsorted(self.along, self.along[places] + reach + 1e-12, side="right") - 1, places + 1)

    def turns(self, before: IndexArray, at: IndexArray, after: IndexArray) -> FloatArray:
        """By how much [rad] the way from places `before` over those `at` to those `after` turns, to the left positive."""
        a, b, c = (self.ring[places % self.count] for places in (before, at, after))
        arrive, leave = b - a, c - b
        cross = arrive[:, 0] * leave[:, 1] - arrive[:, 1] * leave[:, 0]
        return np.asarray(np.arctan2(cross, np.einsum("ij,ij->i", arrive, leave)))

    def apart(self, one: int, other: int) -> float:
        """The length [m] of border between two vertices."""
        between = abs(float(self.along[one] - self.along[other]))
        return min(between, self.length - between)


def _corners(ring: FloatArray, angle: float) -> set[int]:
    """Vertices at which the border turns by more than `angle` [rad], and most within the window around them."""
    walk, turns = _Walk(ring), np.abs(_turns(ring))
    corners = _narrow_ends(walk, angle)
    for i in sorted(np.flatnonzero(turns > angle).tolist(), key=lambda i: (-turns[i], i)):
        # The window of a corner shows in its neighbours' turns too; the next vertex of a coarse border does not.
        if all(walk.apart(i, j) > walk.window for j in corners):
            corners.append(i)
    return set(corners)


def _narrow_ends(walk: _Walk, angle: float) -> list[int]:
    """The corners at the ends of straps, ties and bindings, which lie within one window of each other.

    Between two such corners the border turns back, by more than `END`: so does no tooth of a ragged one, which turns the other way
    beside them. And each of them turns by more than `angle` [rad] over a quarter of the way to the other: no rounded end does.
    """
    found: list[tuple[float, float, int, int]] = []
    for steps in range(1, walk.count // 2):
        one, other = walk.here, walk.here + steps
        close = walk.along[other] - walk.along[one] <= walk.window + 1e-12
        if not close.any():
            break
        one, other = one[close], other[close]
        apart = walk.along[other] - walk.along[one]
        ways = [(walk.back(one, walk.window), one, other), (one, other, walk.on(other, walk.window))]
        ways += [(walk.back(at, apart / 4), at, walk.on(at, apart / 4)) for at in (one, other)]
        turns = np.stack([walk.turns(*way) for way in ways])
        total = turns[0] + turns[1]
        sharp = (np.sign(total) * turns).min(axis=0)
        for k in np.flatnonzero((sharp > angle) & (np.abs(total) > END)).tolist():
            found.append((-float(sharp[k]), float(apart[k]), int(one[k]) % walk.count, int(other[k]) % walk.count))
    corners: list[int] = []
    for _, apart_by, *pair in sorted(found):
        if all(walk.apart(i, j) > apart_by / 2 for i in pair for j in corners if i != j):
            corners += [i for i in pair if i not in corners]
    return corners


def line_labels(loop: IntArray, curves: Mapping[str, IntArray]) -> list[str]:
    """For each border edge, from loop[i] to loop[i + 1], the feature line along it, or ""."""
    label: dict[tuple[int, int], str] = {}
    for key, curve in curves.items():
        for a, b in zip(curve[:-1].tolist(), curve[1:].tolist(), strict=True):
            label.setdefault((min(a, b), max(a, b)), key)
    around = [*loop.tolist(), int(loop[0])]
    return [label.get((min(a, b), max(a, b)), "") for a, b in pairwise(around)]


def _dart_places(
    loop: IntArray, darts: Mapping[str, tuple[int, int, int]], name: str
) -> dict[str, tuple[int, int, int]]:
    """Places in the loop of each dart's left mouth, tip and right mouth."""
    where = {vertex: place for place, vertex in enumerate(loop.tolist())}
    places = {}
    for key, dart in darts.items():
        for vertex in dart:
            if vertex not in where:
                raise InputError(f"piece {name!r}: dart {key!r}: vertex {vertex} is not on the outer border")
        left, tip, right = (where[vertex] for vertex in dart)
        if (tip - left) % len(loop) >= (right - left) % len(loop):
            raise InputError(
                f"piece {name!r}: dart {key!r}: give its vertices counter-clockwise: left mouth, tip, right mouth"
            )
        places[key] = (left, tip, right)
    return places


def _cracks(ring: FloatArray, corners: set[int], known: set[int]) -> list[tuple[int, int, int]]:
    """Sharp inward tips between two legs of equal length that end in the nearest corners."""
    turns = _turns(ring)
    step = segment_lengths(ring, closed=True)
    count = len(ring)
    found = []
    for tip in np.flatnonzero(turns < -TIP).tolist():
        if tip in known:
            continue
        left = next((k for k in range(1, count) if (tip - k) % count in corners), 0)
        right = next((k for k in range(1, count) if (tip + k) % count in corners), 0)
        legs = (
            float(sum(step[(tip - k) % count] for k in range(1, left + 1))),
            float(sum(step[(tip + k) % count] for k in range(right))),
        )
        if left and right and abs(legs[0] - legs[1]) <= LEGS * max(legs):
            found.append(((tip - left) % count, tip, (tip + right) % count))
    return found


def _between(places: tuple[int, int, int], count: int) -> set[int]:
    """Places strictly between the two mouths of a dart."""
    return {(places[0] + k) % count for k in range(1, (places[2] - places[0]) % count)}


def _edges(
    flat: FloatArray,
    loop: IntArray,
    splits: Sequence[int],
    labels: Sequence[str],
    darts: Mapping[str, tuple[int, int, int]],
    kinds: Mapping[str, str],
    allowances: Mapping[str, float],
    name: str,
) -> list[Edge]:
    legs = {places[0]: f"{key}.left" for key, places in darts.items()}
    legs |= {places[1]: f"{key}.right" for key, places in darts.items()}
    count, used, plain = len(loop), dict[str, int](), 0
    stretches: list[tuple[str, IntArray]] = []
    for start, end in zip(splits, [*splits[1:], splits[0] + count], strict=True):
        vertices = loop[np.arange(start, end + 1) % count]
        title = legs.get(start, labels[start])
        if not title:
            plain += 1
            title = f"edge_{plain}"
        used[title] = used.get(title, 0) + 1
        stretches.append((title if used[title] == 1 else f"{title}_{used[title]}", vertices))
    names = [title for title, _ in stretches]
    for what, mapping in (("kinds", kinds), ("allowances", allowances)):
        for key in mapping:
            if key not in names:
                raise InputError(f"piece {name!r}: {what} name an edge {key!r} that it has not; {nearest(key, names)}")
    return [
        Edge(
            name=title,
            points=flat[vertices],
            kind="dart" if title in legs.values() else kinds.get(title, "seam"),
            allowance=allowances.get(title),
            vertices=vertices,
        )
        for title, vertices in stretches
    ]


def _internal(
    flat: FloatArray, faces: IntArray, loops: Sequence[IntArray], curves: Mapping[str, IntArray]
) -> dict[str, FloatArray]:
    """The stretches of feature lines that do not run along a border."""
    border = {
        (min(a, b), max(a, b)) for loop in loops for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
    }
    internal: dict[str, FloatArray] = {}
    for key, curve in curves.items():
        runs: list[list[int]] = [[]]
        for a, b in zip(curve[:-1].tolist(), curve[1:].tolist(), strict=True):
            if (min(a, b), max(a, b)) in border:
                runs.append([])
            else:
                runs[-1] += [b] if runs[-1] else [a, b]
        for index, run in enumerate([run for run in runs if run]):
            internal[key if index == 0 else f"{key}_{index + 1}"] = flat[run]
    return internal


def _grain(flat: FloatArray, loop: IntArray, line: IntArray, key: str, name: str) -> FloatArray:
    """Along the line's ends, but inside the piece: a datum line is often its border."""
    span = flat[line[-1]] - flat[line[0]]
    length = float(np.linalg.norm(span))
    if length < 1e-6:
        raise InputError(f"piece {name!r}: line {key!r} is closed and gives the grain no direction")
    x, y = span / length
    turn = np.array([[y, -x], [x, y]])
    return default_grain(flat[loop] @ turn.T) @ turn
