"""How sleeves are cut: set in at the armhole or below a dropped shoulder, on to the neck (raglan), or in one with the bodice (kimono)."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, points_at_lengths, polyline_length, unit
from warpflat.garment.mannequin.layout import Layout

__all__ = [
    "RAGLAN_LINES",
    "SET_IN",
    "SLEEVE_CUTS",
    "SleeveCut",
    "drop_shoulders",
    "recut_sleeves",
    "slide_raglan",
    "straighten_hems",
]

#: Of a piece its patterns of bricks, and the lines along which it is open.
BricksAndOpen = tuple[tuple[str, ...], tuple[str, ...]]

SLEEVE_CUTS = ("set-in", "dropped", "raglan", "kimono")
#: The seam of a raglan sleeve follows the line below the shoulder, and runs on along the armhole.
RAGLAN_LINES = {f"yoke {face} {side}": f"armhole {side}" for face in ("front", "back") for side in ("left", "right")}
# The seam of a raglan sleeve meets the armhole at least so far from the shoulder and above the line across the chest [m].
_LEAST = 0.02
# A hem that has moved lies on other cloth, which unfolds in another way: after so many rounds it moves by less than .1 mm.
_HEM_ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class SleeveCut:
    """How sleeves are cut.

    Attributes:
        cut: one of `SLEEVE_CUTS`.
        front_cm, back_cm: how far from the shoulder, along the armhole, the seam of a raglan sleeve meets it [cm].
        drop_cm: how far down the arm a dropped shoulder reaches [cm].
    """

    cut: str = "set-in"
    front_cm: float = 9.0
    back_cm: float = 10.0
    drop_cm: float = 4.0


#: The usual one.
SET_IN = SleeveCut()


def recut_sleeves(pieces: Mapping[str, BricksAndOpen], cut: str) -> dict[str, BricksAndOpen]:
    """Return the bricks and the open lines of the pieces of a form whose sleeves reach to the neck, or are parts of the bodice's pieces.

    A raglan sleeve takes what lies between the neck, the shoulder and the armhole; a sleeve in one piece is open along the shoulder, as a
    dart. A kimono's front and back take the front and the back half of each sleeve.

    Args:
        pieces: with sleeves that are set in.
        cut: one of `SLEEVE_CUTS`.

    Raises:
        InputError: the form has no sleeves, or no pieces that reach to the shoulder.
    """
    arms = {
        name: [brick.partition("/") for brick in bricks if brick.partition("/")[2].startswith("arm-")]
        for name, (bricks, _) in pieces.items()
    }
    shoulders = {
        name: [brick.partition("/")[2] for brick in bricks if brick.startswith(("shoulder-", "neck-"))]
        for name, (bricks, _) in pieces.items()
    }
    if not any(arms.values()) or not any(shoulders.values()):
        raise InputError(f"sleeve: cut = {cut!r}: the form has no sleeves, or nothing that reaches to the shoulders")
    if cut in ("set-in", "dropped"):
        return dict(pieces)
    found: dict[str, BricksAndOpen] = {}
    for name, (bricks, opened) in pieces.items():
        trunk = [brick for brick in bricks if not brick.partition("/")[2].startswith("arm-")]
        if cut == "kimono":
            if not trunk:
                continue
            bricks += tuple(
                f"{band}/arm-{side}-{face}"
                for side in ("left", "right")
                for face in ("front", "back")
                for band in dict.fromkeys(band for row in arms.values() for band, _, column in row if side in column)
                if any(column.startswith((f"{face}-*", f"{face}-{side}")) for column in shoulders[name])
            )
        elif arms[name]:
            # As "arm-left-*", or one half of it.
            halves = sorted({tuple(column.split("-")[1:]) for _, _, column in arms[name]})
            bricks += tuple(f"shoulder-yoke/{face}-{side}-*" for side, face in halves)
            opened += tuple(f"shoulder {side}" for side, face in halves if face == "*")
        else:
            bricks = tuple(re.sub("^(shoulder|neck)-", "yoke-", brick) for brick in bricks)
        # A form that is cut so already stays as it is.
        found[name] = tuple(dict.fromkeys(bricks)), tuple(dict.fromkeys(opened))
    return found


def slide_raglan(layout: Layout, vertices: FloatArray, cut: SleeveCut) -> FloatArray:
    """Return a form's vertices (#V by 3 [m]) with the line below each shoulder moved to where a raglan sleeve is sewn.

    Each upright column of the grid slides along itself, from not at all at the neck to as far as it takes at the armhole.

    Raises:
        InputError: the armhole is not that long.
    """
    out = vertices.copy()
    for face, grid, depth in (("front", layout.front, cut.front_cm), ("back", layout.back, cut.back_cm)):
        for side in ("left", "right"):
            upper = layout.yokes[f"{face}-{side}"]
            # Columns from the neck to the armhole.
            outwards = 1 if upper[-1, 0] in layout.neck[0] else -1
            upper = upper[:, ::outwards]
            columns = [int((grid[-1] == vertex).argmax()) for vertex in upper[0]]
            armhole = [*upper[::-1, -1], *grid[-2::-1, columns[-1]]]
            whole, at = arc_lengths(vertices[armhole])[[-1, len(upper) - 1]]
            most = whole - _LEAST
            if not _LEAST <= 0.01 * depth <= most:
                raise InputError(
                    f"sleeve: {face}_cm = {depth:g}: a seam can begin {100 * _LEAST:.0f} to {100 * most:.1f} cm below the shoulder"
                )
            for number, column in enumerate(columns):
                share = number / (len(columns) - 1)
                ids = [*upper[::-1, number], *grid[-2::-1, column]]
                farther = share * (0.01 * depth - at) * polyline_length(vertices[ids]) / whole
                out[ids] = _slid(vertices[ids], len(upper) - 1, farther)
    return out


def drop_shoulders(layout: Layout, vertices: FloatArray, cut: SleeveCut) -> FloatArray:
    """Return a form's vertices (#V by 3 [m]) with the upper half of each armhole moved down the arm, most at the shoulder.

    Each row of the grid that ends in the armhole slides along itself and on along the arm; the rest of the arm shares what is left.

    Raises:
        InputError: the shoulder would drop to the biceps.
    """
    out, biceps = vertices.copy(), layout.arm_row["biceps"]
    for arm in layout.arms.values():
        place = {vertex: column for column, vertex in enumerate(arm[0].tolist())}
        middle, half = arm.shape[1] // 2, len(layout.front) - 1 + len(layout.yokes["front-left"]) - 1
        room = arc_lengths(vertices[arm[: biceps + 1, middle]])[-1] - _LEAST
        if 0.01 * cut.drop_cm > room:
            raise InputError(f"sleeve: drop_cm = {cut.drop_cm:g}: a shoulder can drop by at most {100 * room:.1f} cm")
        centre = layout.front.shape[1] // 2
        halves = [
            grid[:, part]
            for grid in (layout.front, layout.back)
            for part in (slice(centre, None), slice(centre, None, -1))
        ]
        for grid in (*halves, *layout.yokes.values()):
            for row in grid:
                row = row if row[-1] in place else row[::-1]
                if row[-1] not in place:
                    continue
                column = place[int(row[-1])]
                near = np.cos(0.5 * np.pi * min(abs(column - middle) / half, 1.0)) ** 2
                ids = [*row, *arm[1 : biceps + 1, column]]
                out[ids] = _slid(vertices[ids], len(row) - 1, 0.01 * cut.drop_cm * near)
    return out


def straighten_hems(
    layout: Layout, vertices: FloatArray, pieces: Mapping[str, tuple[Collection[str], Collection[str]]]
) -> FloatArray:
    """Return a form's vertices (#V by 3 [m]) with the hems of its sleeves where they are straight once the sleeve lies flat.

    A level of the arm around a sleeve that narrows lies flat as an arc. The hem slides along the columns of the grid until it is the
    shortest line on the sleeve. The shortest sleeve, which ends at the biceps, keeps its seam under the arm, and longer ones the length
    over the arm.

    Args:
        layout: the grid.
        vertices: #V by 3 [m].
        pieces: of each piece its bricks, and the lines along which it is open.
    """
    count = np.zeros(len(vertices), np.int32)
    for bricks, _ in pieces.values():
        count[np.unique(layout.faces[layout.faces_of(bricks)])] += 1
    for _, opened in pieces.values():
        count[np.concatenate([layout.lines[line] for line in opened] or [np.zeros(0, np.int32)])] += 1
    out = vertices.copy()
    for arm in layout.arms.values():
        hem = int(np.flatnonzero((count[arm] > 0).all(axis=1))[-1]) if (count[arm[0]] > 0).all() else 0
        sewn = np.flatnonzero(count[arm[hem]] > 1)
        if hem == 0 or not len(sewn):
            continue
        levels = sorted(layout.arm_row.values())
        start = max(level for level in levels if level < hem)
        end = min([level for level in levels if level > hem], default=hem)
        for _ in range(_HEM_ROUNDS):
            further = np.zeros(arm.shape[1])
            for first, last in zip(sewn, [*sewn[1:], sewn[0] + arm.shape[1]], strict=True):
                columns = np.arange(first, last + 1) % arm.shape[1]
                flat = _unfolded(out[arm[(start + hem) // 2, columns]], out[arm[hem, columns]])
                along = unit(flat[-1] - flat[0])
                further[columns] = (flat - flat[0]) @ [-along[1], along[0]]
            if hem > layout.arm_row["biceps"]:
                further -= further[arm.shape[1] // 2]
            for column, more in enumerate(further):
                ids = arm[start : end + 1, column]
                # Beyond the wrist a sleeve runs on as it comes.
                line = np.vstack([out[ids], 2.0 * out[ids[-1]] - out[arm[end - 1, column]]])
                out[ids] = _slid(line, hem - start, more)[:-1]
    return out


def _slid(line: FloatArray, row: int, farther: float) -> FloatArray:
    """Return the points of a line slid along it: that of a row so much farther [m], both ends not at all, the others in proportion."""
    arc = arc_lengths(line)
    at = np.interp(arc, [0.0, arc[row], arc[-1]], [0.0, arc[row] + farther, arc[-1]])
    return points_at_lengths(line, at)


def _unfolded(upper: FloatArray, lower: FloatArray) -> FloatArray:
    """Return the lower line (#P by 2) of a strip of triangles between two lines (#P by 3) as it lies flat, the upper one above it."""
    flat = [np.zeros(2), np.array([0.0, np.linalg.norm(upper[0] - lower[0])])]
    strip = np.stack([lower, upper], axis=1).reshape(-1, 3)
    for k in range(2, len(strip)):
        a, b = flat[-2], flat[-1]
        base, r, s = np.linalg.norm(strip[[k - 2, k - 2, k - 1]] - strip[[k - 1, k, k]], axis=1)
        x = (base**2 + r**2 - s**2) / (2.0 * base)
        y = np.sqrt(max(r**2 - x**2, 0.0))
        along = (b - a) / base
        # Triangles turn to and fro; the strip runs to the right.
        flat.append(a + x * along + y * np.array([along[1], -along[0]]) * (1.0 if k % 2 == 0 else -1.0))
    return np.array(flat[::2])
