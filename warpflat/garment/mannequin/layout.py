"""The grid of the mannequin: which vertex is where, independent of anybody's size.

Closed rings run from the ankle to the bust and on to the across-chest row, whose ends dip into the armholes. Above it
the front and the back are separate patches up to the yoke row, which starts at the bend of the neckline; four small
patches climb from there to the shoulder seams. No corner of the grid is then sharper than about sixty degrees, which a
single grid from chest to neck and shoulder cannot offer.

At the hip the rings divide. One tube runs on to the ankle around both legs, as a skirt hangs and a tape lies. Inside it are
the legs: the left or right half of the hip's row and the crotch curve, which runs in the midplane from centre front under the
body to centre back, close to a loop, from which each leg runs down to its ankle.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpflat.core import InputError, IntArray, short_repr
from warpflat.flat import grid_quads, half_edges

__all__ = [
    "ARM_LEVELS",
    "EASED_LEVELS",
    "LEG_LEVELS",
    "LEG_LINES",
    "QUARTERS",
    "RING_LEVELS",
    "TRUNK_RINGS",
    "Layout",
    "joined_runs",
    "make_layout",
]

#: Closed horizontal levels, bottom up.
RING_LEVELS = ("ankle", "knee", "thigh", "hip", "abdomen", "waist", "underbust", "bust")
#: Those of the trunk.
TRUNK_RINGS = RING_LEVELS[RING_LEVELS.index("hip") :]
ARM_LEVELS = ("armhole", "biceps", "elbow", "forearm", "wrist")
#: Closed levels of one leg from the top down; the first is half of the hip's row and the crotch curve.
LEG_LEVELS = ("crotch", "leg_thigh", "leg_knee", "leg_calf", "leg_ankle")
#: Closed levels that may have ease: all but armhole and crotch curve, and the across-chest row.
EASED_LEVELS = (*RING_LEVELS, "chest", *ARM_LEVELS[1:], *LEG_LEVELS[1:])
#: The line of a leg's level, less its side.
LEG_LINES = {level: level.removeprefix("leg_") for level in LEG_LEVELS[1:]}
#: In the order in which a ring runs: from centre front over the body's left to the back.
QUARTERS = ("front-left", "back-left", "back-right", "front-right")

# Lengths [m] of the grid's strips on a middle size; only they and the resolution decide the counts.
_COLUMN_LENGTHS = (0.045, 0.045, 0.065, 0.065)
_RING_GAPS = (0.33, 0.25, 0.10, 0.10, 0.075, 0.10, 0.07)
_CHEST_GAP, _YOKE_GAP, _SHOULDER_GAP, _COLLAR_GAP = 0.055, 0.100, 0.045, 0.045
_ARM_GAPS = (0.10, 0.16, 0.12, 0.13)
# The crotch curve from the front to the crotch point and on to the back.
_CROTCH_LENGTHS = (0.08, 0.14)
_LEG_GAPS = (0.10, 0.27, 0.12, 0.24)


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """The strips of the grid, as vertex indices. Rows run upward (outward on arms), columns from the front leftward.

    Attributes:
        resolution: wished quad edge [m].
        columns: cells per quarter from the centre to the neck column, the princess line, the arm column, the side.
        rings: #rows by #columns, closed rows from the ankle to the across-chest row.
        level_row: row in `rings` of every level, ``chest`` included.
        front: #rows by #columns, from the across-chest row to the yoke row, right to left armhole.
        back: the same on the back, left to right armhole.
        yokes: for each quarter #rows by #columns, from the yoke row to the shoulder seam.
        neck: #rows by #columns, closed rows from the neck base upward.
        arms: for ``left`` and ``right`` #rows by #columns, closed rows from armhole to wrist, columns from the underarm
            forward.
        arm_row: row in `arms` of every arm level.
        crotch: the crotch curve from the hip's centre front to its centre back.
        crotch_point: index in `crotch` of the vertex where the inseams begin.
        legs: for ``left`` and ``right`` #rows by #columns, closed rows from hip and crotch curve to the ankle, columns from
            the inseam forward.
        leg_row: row in `legs` of every leg level.
        vertex_count: number of vertices.
    """

    resolution: float
    columns: tuple[int, int, int, int]
    rings: IntArray
    level_row: Mapping[str, int]
    front: IntArray
    back: IntArray
    yokes: Mapping[str, IntArray]
    neck: IntArray
    arms: Mapping[str, IntArray]
    arm_row: Mapping[str, int]
    crotch: IntArray
    crotch_point: int
    legs: Mapping[str, IntArray]
    leg_row: Mapping[str, int]
    vertex_count: int

    @cached_property
    def mirror(self) -> IntArray:
        """#V, the mirror image of each vertex at the midplane."""
        out = np.full(self.vertex_count, -1, np.int32)
        n = self.rings.shape[1]
        out[self.rings] = self.rings[:, -np.arange(n) % n]
        for patch in (self.front, self.back):
            out[patch] = patch[:, ::-1]
        for face in ("front", "back"):
            left, right = self.yokes[f"{face}-left"], self.yokes[f"{face}-right"]
            out[left], out[right] = right[:, ::-1], left[:, ::-1]
        m = self.neck.shape[1]
        out[self.neck] = self.neck[:, -np.arange(m) % m]
        out[self.arms["left"]], out[self.arms["right"]] = self.arms["right"], self.arms["left"]
        out[self.legs["left"]], out[self.legs["right"]] = self.legs["right"], self.legs["left"]
        return out

    @property
    def quarter(self) -> int:
        """Columns from the centre line to the side line."""
        return sum(self.columns)

    @property
    def to_arm(self) -> int:
        """Columns from the centre line to the arm column."""
        return sum(self.columns[:3])

    @property
    def to_princess(self) -> int:
        """Columns from the centre line to the princess line."""
        return sum(self.columns[:2])

    @property
    def to_outseam(self) -> int:
        """Columns of a leg from the inseam over the front to the outseam."""
        return self.crotch_point + self.quarter


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout(Strips):
    """The grid of the mannequin: its strips, and the bricks, lines and faces on them.

    Attributes:
        bricks: grid of vertex indices of every brick by name.
        lines: feature profiles and lines by name; a closed one repeats its first vertex.
        faces: #F by 4, outward.
        face_brick: #F, index of the brick in `bricks`' order.
        on_body: #F, true on the body itself, false on the tube around both legs.
    """

    __repr__ = short_repr

    bricks: Mapping[str, IntArray]
    lines: Mapping[str, IntArray]
    faces: IntArray
    face_brick: IntArray
    on_body: NDArray[np.bool_]

    @property
    def body_faces(self) -> IntArray:
        """The faces of the body itself, without the tube around both legs."""
        return self.faces[self.on_body]

    def faces_of(self, bricks: Collection[str]) -> NDArray[np.int64]:
        """Return the indices of the faces of some bricks."""
        return np.flatnonzero(np.isin(self.face_brick, [i for i, name in enumerate(self.bricks) if name in bricks]))

    def edges_along(self, *lines: str) -> set[tuple[int, int]]:
        """Return the mesh edges along some lines, the lower vertex first."""
        return {(min(ends), max(ends)) for line in lines for ends in itertools.pairwise(self.lines[line].tolist())}

    def edges_of(self, bricks: Collection[str], *, inside: bool = False) -> set[tuple[int, int]]:
        """Return the mesh edges of some bricks, the lower vertex first; those between two of their faces alone, if asked for."""
        sides = half_edges(self.faces[self.faces_of(bricks)])
        return set(map(tuple, sides.edges[sides.count == 2 if inside else slice(None)].tolist()))

    @property
    def body_lines(self) -> dict[str, IntArray]:
        """The parts of the lines that lie on the body itself."""
        tube = self.rings[: self.level_row["hip"]]
        kept = {name: ids[~np.isin(ids, tube)] for name, ids in self.lines.items()}
        return {name: ids for name, ids in kept.items() if len(ids)}


def make_layout(resolution_mm: float = 10.0) -> Layout:
    """Make the grid at a resolution; it is one for all bodies.

    Args:
        resolution_mm: wished quad edge [mm], 2 to 40.

    Raises:
        InputError: if the resolution is out of range.
    """
    if not 2.0 <= resolution_mm <= 40.0:
        raise InputError(f"mannequin resolution {resolution_mm:g} mm: valid range 2 to 40 mm")
    strips = _strips(resolution_mm / 1000.0)
    # Feature profiles (closed around the body or an arm) and feature lines, bottom up.
    n0, n1, n2, _ = strips.columns
    p, k, q = strips.to_princess, strips.to_arm, strips.quarter
    rings, front, back, yokes, neck = strips.rings, strips.front, strips.back, strips.yokes, strips.neck

    def loop(ids: IntArray) -> IntArray:
        return np.append(ids, ids[:1])

    lines = {level: loop(rings[strips.level_row[level]]) for level in RING_LEVELS}
    lines |= {"chest front": front[0], "chest back": back[0]}
    lines |= {"yoke front left": front[-1, k + n0 :], "yoke front right": front[-1, : k - n0 + 1]}
    lines |= {"yoke back left": back[-1, : k - n0 + 1], "yoke back right": back[-1, k + n0 :]}
    lines |= {"neck": loop(neck[0]), "collar": loop(neck[-1])}
    lines |= {"shoulder left": yokes["front-left"][-1], "shoulder right": yokes["front-right"][-1][::-1]}
    lines["centre front"] = np.concatenate([rings[:, 0], front[1:, k], neck[1:, 0]])
    lines["centre back"] = np.concatenate([rings[:, 2 * q], back[1:, k], neck[1:, neck.shape[1] // 2]])
    lines["side left"], lines["side right"] = rings[:, q], rings[:, 3 * q]
    for name, column, patch, at, up in (
        ("princess front left", p, front, k + p, yokes["front-left"][:, n1]),
        ("princess front right", 4 * q - p, front, k - p, yokes["front-right"][:, n2]),
        ("princess back left", 2 * q - p, back, k - p, yokes["back-left"][:, n2]),
        ("princess back right", 2 * q + p, back, k + p, yokes["back-right"][:, n1]),
    ):
        lines[name] = np.concatenate([rings[:, column], patch[1:, at], up[1:]])
    for side, grid in strips.arms.items():
        for level in ARM_LEVELS:
            lines[f"{level} {side}"] = loop(grid[strips.arm_row[level]])
        lines[f"underarm {side}"] = grid[:, 0]
        lines[f"overarm {side}"] = grid[:, grid.shape[1] // 2]
    lines["crotch front"] = strips.crotch[: strips.crotch_point + 1]
    lines["crotch back"] = strips.crotch[strips.crotch_point :]
    for side, grid in strips.legs.items():
        lines |= {f"{line} {side}": loop(grid[strips.leg_row[level]]) for level, line in LEG_LINES.items()}
        lines[f"inseam {side}"], lines[f"outseam {side}"] = grid[:, 0], grid[:, strips.to_outseam]
        lines[f"crease front {side}"] = grid[:, strips.to_outseam - q + p]
        lines[f"crease back {side}"] = grid[:, strips.to_outseam + q - p]
    bricks = _bricks(strips)
    quads = [grid_quads(grid) for grid in bricks.values()]
    face_brick = np.repeat(np.arange(len(bricks)), [len(each) for each in quads])
    tube = set(strips.rings[: strips.level_row["hip"]].ravel().tolist())
    around = [bool(tube & set(grid.ravel().tolist())) for grid in bricks.values()]
    return Layout(
        **vars(strips), bricks=bricks, lines={name: np.ascontiguousarray(ids, np.int32) for name, ids in lines.items()},
        faces=np.concatenate(quads).astype(np.int32), face_brick=face_brick.astype(np.int32),
        on_body=~np.array(around)[face_brick],
    )  # fmt: skip


def _strips(resolution: float) -> Strips:
    """Number the vertices of the grid, strip by strip, for a wished quad edge [m]."""

    def cells(length: float, least: int = 2) -> int:
        return max(least, round(length / resolution))

    n0, n1, n2, n3 = (cells(s) for s in _COLUMN_LENGTHS)
    k, q, n = n0 + n1 + n2, n0 + n1 + n2 + n3, 4 * (n0 + n1 + n2 + n3)
    counter = itertools.count()

    def fresh(*shape: int) -> IntArray:
        size = int(np.prod(shape))
        return np.fromiter(itertools.islice(counter, size), np.int32, size).reshape(shape)

    steps = [cells(g) for g in _RING_GAPS]
    level_row = dict(zip(RING_LEVELS, [0, *np.cumsum(steps).tolist()], strict=True))
    level_row["chest"] = level_row["bust"] + cells(_CHEST_GAP)
    rings = fresh(level_row["chest"] + 1, n)
    m2, m3 = cells(_YOKE_GAP), cells(_SHOULDER_GAP)
    front = np.vstack([rings[-1][np.arange(-k, k + 1) % n], fresh(m2, 2 * k + 1)])
    back = np.vstack([rings[-1][np.arange(2 * q - k, 2 * q + k + 1)], fresh(m2, 2 * k + 1)])
    # The four patches under the shoulder seams; front and back share the seam's vertices.
    width = k - n0 + 1
    starts = {
        "front-left": front[-1, k + n0 :],
        "back-left": back[-1, :width],
        "back-right": back[-1, k + n0 :],
        "front-right": front[-1, :width],
    }
    yokes = {name: np.vstack([row, fresh(m3 - 1, width)]) for name, row in starts.items()}
    for side in ("left", "right"):
        seam = fresh(1, width)
        yokes[f"front-{side}"] = np.vstack([yokes[f"front-{side}"], seam])
        yokes[f"back-{side}"] = np.vstack([yokes[f"back-{side}"], seam[:, ::-1]])

    fl, bl, br, fr = (yokes[name] for name in QUARTERS)
    neck_loop = np.concatenate([
        front[-1, k : k + n0 + 1], fl[1:, 0], bl[-2::-1, -1], back[-1, k - n0 + 1 : k + n0 + 1],
        br[1:, 0], fr[-2::-1, -1], front[-1, k - n0 + 1 : k],
    ])  # fmt: skip
    neck = np.vstack([neck_loop, fresh(cells(_COLLAR_GAP), len(neck_loop))])
    top = rings[-1]
    armholes = {
        "left": np.concatenate([
            top[q : k - 1 : -1], front[1:, -1], fl[1:, -1], bl[-2::-1, 0], back[-2::-1, 0], top[2 * q - k - 1 : q : -1],
        ]),
        "right": np.concatenate([
            top[3 * q : 4 * q - k + 1], front[1:, 0], fr[1:, 0], br[-2::-1, -1], back[-2::-1, -1],
            top[2 * q + k + 1 : 3 * q],
        ]),
    }  # fmt: skip
    arm_steps = [cells(g) for g in _ARM_GAPS]
    arm_row = dict(zip(ARM_LEVELS, [0, *np.cumsum(arm_steps).tolist()], strict=True))
    arms = {side: np.vstack([loop, fresh(arm_row["wrist"], len(loop))]) for side, loop in armholes.items()}

    hip = rings[level_row["hip"]]
    to_point, to_back = (cells(s) for s in _CROTCH_LENGTHS)
    crotch = np.concatenate([hip[:1], fresh(to_point + to_back - 1), hip[2 * q : 2 * q + 1]])
    from_point, under = crotch[to_point:0:-1], crotch[:to_point:-1]
    loops = {
        "left": np.concatenate([from_point, hip[: 2 * q], under]),
        "right": np.concatenate([from_point, hip[-np.arange(2 * q) % n], under]),
    }
    leg_row = dict(zip(LEG_LEVELS, [0, *np.cumsum([cells(g) for g in _LEG_GAPS]).tolist()], strict=True))
    legs = {side: np.vstack([loop, fresh(leg_row["leg_ankle"], len(loop))]) for side, loop in loops.items()}

    return Strips(
        resolution=resolution, columns=(n0, n1, n2, n3), rings=rings, level_row=level_row, front=front, back=back,
        yokes=yokes, neck=neck, arms=arms, arm_row=arm_row, crotch=crotch, crotch_point=to_point, legs=legs,
        leg_row=leg_row, vertex_count=next(counter),
    )  # fmt: skip


def joined_runs(edges: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return the vertices of each run of edges that follow each other; the last run of a closed line is joined to its first."""
    runs: list[list[int]] = []
    for a, b in edges:
        if runs and runs[-1][-1] == a:
            runs[-1].append(b)
        else:
            runs.append([a, b])
    if len(runs) > 1 and runs[-1][-1] == runs[0][0]:
        runs[0] = [*runs.pop(), *runs[0][1:]]
    return runs


def _bricks(strips: Strips) -> dict[str, IntArray]:
    """Return the grid of every brick by its name, ``upper-lower/column``: from the neck down, arms, legs, the tube around both."""
    n0, n1, n2, _ = strips.columns
    p, k, q = strips.to_princess, strips.to_arm, strips.quarter
    front, back, yokes, neck = strips.front, strips.back, strips.yokes, strips.neck
    bricks: dict[str, IntArray] = {}
    m3 = len(yokes["front-left"]) - 1
    quarter_neck = n0 + m3
    closed_neck = np.hstack([neck, neck[:, :1]])
    for i, name in enumerate(QUARTERS):
        bricks[f"collar-neck/{name}"] = closed_neck[:, i * quarter_neck : (i + 1) * quarter_neck + 1]
    for name in QUARTERS:
        grid = yokes[name]
        split = n1 if name in ("front-left", "back-right") else n2
        near, far = grid[:, : split + 1], grid[:, split:]
        centre, side = (near, far) if name in ("front-left", "back-right") else (far, near)
        bricks[f"shoulder-yoke/{name}-centre"] = centre
        bricks[f"shoulder-yoke/{name}-side"] = side
    bricks |= {
        "yoke-chest/front-left-centre": front[:, k : k + p + 1],
        "yoke-chest/front-left-side": front[:, k + p :],
        "yoke-chest/back-left-side": back[:, : k - p + 1],
        "yoke-chest/back-left-centre": back[:, k - p : k + 1],
        "yoke-chest/back-right-centre": back[:, k : k + p + 1],
        "yoke-chest/back-right-side": back[:, k + p :],
        "yoke-chest/front-right-side": front[:, : k - p + 1],
        "yoke-chest/front-right-centre": front[:, k - p : k + 1],
    }
    closed = np.hstack([strips.rings, strips.rings[:, :1]])
    cuts = (0, p, q, 2 * q - p, 2 * q, 2 * q + p, 3 * q, 4 * q - p, 4 * q)
    orders = (("centre", "side"), ("side", "centre")) * 2
    names = [f"{quarter}-{part}" for quarter, order in zip(QUARTERS, orders, strict=True) for part in order]
    levels = [*RING_LEVELS, "chest"]
    tube: dict[str, IntArray] = {}
    for low, high in reversed(list(itertools.pairwise(levels))):
        part = bricks if strips.level_row[low] >= strips.level_row["hip"] else tube
        rows = closed[strips.level_row[low] : strips.level_row[high] + 1]
        for name, a, b in zip(names, cuts[:-1], cuts[1:], strict=True):
            part[f"{high}-{low}/{name}"] = rows[:, a : b + 1]
    for body_side, limb in strips.arms.items():
        bricks |= _limb_bricks("arm", body_side, limb, limb.shape[1] // 2, ARM_LEVELS, strips.arm_row)
    for body_side, limb in strips.legs.items():
        bricks |= _limb_bricks("leg", body_side, limb, strips.to_outseam, LEG_LEVELS, strips.leg_row)
    return bricks | tube


def _limb_bricks(
    limb: str, side: str, grid: IntArray, half: int, levels: tuple[str, ...], row_of: Mapping[str, int]
) -> dict[str, IntArray]:
    """Return the front and back bricks of an arm or a leg whose front has `half` columns of cells."""
    loop = np.hstack([grid, grid[:, :1]])
    bricks: dict[str, IntArray] = {}
    for high, low in itertools.pairwise(levels):
        rows = loop[row_of[high] : row_of[low] + 1]
        for name, part in (("front", rows[:, : half + 1]), ("back", rows[:, half:])):
            # Columns run forward from the inside on both sides; the left one's rows are turned, so that it faces outward too.
            bricks[f"{high}-{low}/{limb}-{side}-{name}"] = part[::-1] if side == "left" else part
    return bricks
