"""Laying the grid on a blueprint: rings by their profiles, the shoulders as a smooth sheet between their curves."""

from __future__ import annotations

import itertools

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.polyline import arc_lengths, polyline_length, resample
from warpflat.mannequin.blueprint import Blueprint, Profile, QuarterCurves
from warpflat.mannequin.layout import QUARTERS, RING_LEVELS, Layout
from warpflat.mannequin.leg_builder import set_legs
from warpflat.mannequin.profiles import convex_girth, scale_to_girth
from warpflat.mannequin.sheet import sheet_laplacian

__all__ = ["build_trunk", "build_vertices", "girth_ring", "quarter_fractions"]

# How strongly the sheet is drawn to the across-chest rows and centre lines, and to a scan, against one for its own
# smoothness, on a grid of 10 mm. The operator shrinks with the square of the edge; a curve's and a sheet's count of
# vertices with its inverse and the square of that: hence the powers by which the weights follow the resolution.
_GUIDE = 0.01
_ATTRACT = 0.25
_ATTRACT_ROUNDS = 4


def build_trunk(layout: Layout, blueprint: Blueprint) -> FloatArray:
    """Return the grid's vertices with the rings up to the bust and the legs in their places (layout.vertex_count by 3 [m]), others NaN."""
    vertices = np.full((layout.vertex_count, 3), np.nan)
    _set_rings(vertices, layout, blueprint)
    set_legs(vertices, layout, blueprint.legs)
    return vertices


def build_vertices(layout: Layout, blueprint: Blueprint, trunk: FloatArray | None = None) -> FloatArray:
    """Return the grid's vertices on a body.

    Args:
        layout: the grid.
        blueprint: the body.
        trunk: of :func:`build_trunk`, if it is there; shoulders and arms do not change it.

    Returns:
        layout.vertex_count by 3, positions [m].
    """
    vertices = build_trunk(layout, blueprint) if trunk is None else trunk.copy()
    _dip_sides(vertices, layout, blueprint)
    _set_bounds(vertices, layout, blueprint)
    _set_sides(vertices, layout)
    _set_arms(vertices, layout, blueprint)
    _set_neck(vertices, layout, blueprint)
    _set_sheet(vertices, layout, blueprint)
    return vertices


def quarter_fractions(layout: Layout, princess: float) -> FloatArray:
    """Return shares of a quarter's arc at which its columns stand, from the centre to the side, both included."""
    n0, n1, n2, n3 = layout.columns
    knots = [0.0, 0.5 * princess, princess, princess + 0.50 * (1.0 - princess), 1.0]
    parts = [
        np.linspace(a, b, n, endpoint=False) for a, b, n in zip(knots[:-1], knots[1:], (n0, n1, n2, n3), strict=True)
    ]
    return np.concatenate([*parts, [1.0]])


def girth_ring(layout: Layout, profile: Profile, height: float) -> FloatArray:
    """Return one closed row of the grid, #columns by 3 [m]; a tape around it reads exactly the profile's girth."""
    total = polyline_length(profile.curve, closed=True)
    ends = (
        profile.centre_front,
        profile.side_left,
        profile.centre_back,
        profile.side_right,
        total + profile.centre_front,
    )
    at: list[FloatArray] = []
    for i, name in enumerate(QUARTERS):
        shares = quarter_fractions(layout, profile.princess[name])
        if name in ("back-left", "front-right"):
            shares = 1.0 - shares[::-1]
        at.append(ends[i] + shares[:-1] * (ends[i + 1] - ends[i]))
    flat = resample(profile.curve, np.concatenate(at) / total, closed=True)
    row = np.column_stack([flat[:, 0], np.full(len(flat), height), flat[:, 1]])
    return scale_to_girth(row, profile.girth)


def _set_rings(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    for low, high in itertools.pairwise(RING_LEVELS):
        first, last = layout.level_row[low], layout.level_row[high]
        for row in range(first, last + 1):
            share = (row - first) / (last - first)
            height = (1.0 - share) * blueprint.heights[low] + share * blueprint.heights[high]
            vertices[layout.rings[row]] = girth_ring(layout, blueprint.profile(height), height)


def _dip_sides(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    """Lower the rows from the underbust to the bust at the sides, so that all rows up to the underarm share its height.

    A bust lies level with the armpits on many bodies, and the armhole ends below them. A tape still reads each row's girth.
    """
    first, bust, chest = (layout.level_row[level] for level in ("underbust", "bust", "chest"))
    base = vertices[layout.rings[: bust + 1]].copy()
    heights = base[:, 0, 1]
    quarter, count = layout.quarter, layout.rings.shape[1]
    reach = quarter - layout.to_princess
    for side, name in ((quarter, "front-left"), (3 * quarter, "front-right")):
        under = float(blueprint.quarters[name].armhole[-1, 1])
        for row in range(first + 1, bust + 1):
            even = heights[first] + (under - heights[first]) * (row - first) / (chest - first)
            dip = max(0.0, heights[row] - even)
            for column in range(side - reach + 1, side + reach):
                near = 1.0 - abs(column - side) / reach
                height = heights[row] - near * near * (3.0 - 2.0 * near) * dip
                line = base[:, column % count]
                vertices[layout.rings[row, column % count]] = [np.interp(height, heights, line[:, k]) for k in range(3)]
    for row in range(first + 1, bust + 1):
        ring = layout.rings[row]
        vertices[ring] = scale_to_girth(vertices[ring], convex_girth(base[row]))


def _pieces(curve: FloatArray, knots: list[float], counts: list[int]) -> FloatArray:
    """Return points of a curve: `counts` cells between consecutive `knots` (shares of the length), ends included."""
    spans = zip(knots[:-1], knots[1:], counts, strict=True)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in spans]
    return resample(curve, np.concatenate([*parts, knots[-1:]]))


def _quarter_ids(layout: Layout, name: str) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Return vertex ids of one quarter: neckline from the centre, shoulder from the neck, armhole down, chest row, centre."""
    n0 = layout.columns[0]
    k, q = layout.to_arm, layout.quarter
    face = name.partition("-")[0]
    patch = layout.front if face == "front" else layout.back
    toward_left = name in ("front-left", "back-right")  # columns run away from the centre line
    yoke = layout.yokes[name] if toward_left else layout.yokes[name][:, ::-1]
    half = patch[:, k:] if toward_left else patch[:, k::-1]
    column = {
        "front-left": np.arange(k, q + 1),
        "back-left": np.arange(2 * q - k, q - 1, -1),
        "back-right": np.arange(2 * q + k, 3 * q + 1),
        "front-right": np.arange(4 * q - k, 3 * q - 1, -1),
    }[name]
    neckline = np.concatenate([half[-1, : n0 + 1], yoke[1:, 0]])
    armhole = np.concatenate([yoke[::-1, -1], half[-2::-1, -1], layout.rings[-1][column[1:]]])
    centre_column = 0 if face == "front" else 2 * q
    centre = np.concatenate([layout.rings[layout.level_row["bust"] :, centre_column], half[1:, 0]])
    return neckline, yoke[-1], armhole, half[0], centre


def _set_bounds(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    """Set the vertices of neckline, shoulder seams and armholes."""
    n0, n1, n2, n3 = layout.columns
    m2, m3 = len(layout.front) - 1, len(layout.yokes["front-left"]) - 1
    for name in QUARTERS:
        c = blueprint.quarters[name]
        vertices[_quarter_ids(layout, name)[0]] = _pieces(c.neckline, [0.0, c.bend, 1.0], [n0, m3])
    loop = layout.neck[0]
    vertices[loop] = _to_length(vertices[loop], blueprint.neck)
    for name in QUARTERS:
        c = blueprint.quarters[name]
        neckline, shoulder, armhole, _, _ = _quarter_ids(layout, name)
        seam = _pieces(c.shoulder, [0.0, 0.5, 1.0], [n1, n2])
        # The neck base was a little too short as a polygon; the seam's start follows it.
        follow = np.linspace(1.0, 0.0, len(seam))[:, None] * (vertices[neckline[-1]] - seam[0])
        vertices[shoulder] = seam + follow
        yoke = c.notch * _yoke_share(c)
        vertices[armhole] = _pieces(c.armhole, [0.0, yoke, c.notch, 1.0], [m3, m2, n3])


def _set_sides(vertices: FloatArray, layout: Layout) -> None:
    """Set the side lines from the bust to the underarm points: straight on from the rows below, without a kink."""
    bust, chest = layout.level_row["bust"], layout.level_row["chest"]
    for column in (layout.quarter, 3 * layout.quarter):
        ids = layout.rings[bust : chest + 1, column]
        start, end = vertices[ids[0]], vertices[ids[-1]]
        way = start - vertices[layout.rings[bust - 3, column]]
        corner = start + 0.5 * np.linalg.norm(end - start) / np.linalg.norm(way) * way
        t = np.linspace(0.0, 1.0, len(ids))[1:-1, None]
        vertices[ids[1:-1]] = (1.0 - t) ** 2 * start + 2.0 * t * (1.0 - t) * corner + t**2 * end


def _to_length(loop: FloatArray, length: float) -> FloatArray:
    """Return a closed polygon, #P by 3, blown up about its middle until it is `length` [m] long."""
    middle = loop.mean(axis=0)
    return middle + (loop - middle) * (length / polyline_length(loop, closed=True))


def _yoke_share(c: QuarterCurves) -> float:
    """Return share of the upper armhole, from the shoulder point down to the notch, at which the yoke row ends.

    As far down as the neckline's bend lies below the shoulder seam, within what leaves both strips of rows room.
    """
    upper = c.notch * polyline_length(c.armhole)
    drop = (1.0 - c.bend) * polyline_length(c.neckline)
    return float(np.clip(0.9 * drop / max(upper, 1e-9), 0.22, 0.5))


def _set_arms(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    from scipy.interpolate import PchipInterpolator

    for side, grid in layout.arms.items():
        c = blueprint.arms[side]
        hole = vertices[grid[0]]
        # Columns keep the places they have on the armhole, by arc, from the underarm over the front to the top.
        half = grid.shape[1] // 2
        s = arc_lengths(hole, closed=True)
        shares = np.where(
            np.arange(len(hole)) <= half, 0.5 * s[:-1] / s[half], 0.5 + 0.5 * (s[:-1] - s[half]) / (s[-1] - s[half])
        )
        even = np.arange(len(hole)) / len(hole)
        places = np.array(list(c.by_place))
        evened = np.interp(places, [0.0, 1.0, 2.0], [0.5, 0.8, 1.0])
        rings = [
            _to_length(resample(loop, w * even + (1 - w) * shares, closed=True), polyline_length(loop, closed=True))
            for loop, w in zip(c.by_place.values(), evened, strict=True)
        ]
        rows = layout.arm_row
        at = np.interp(places, [0.0, 1.0, 2.0], [rows["biceps"], rows["elbow"], rows["wrist"]])
        between = np.arange(rows["biceps"], rows["wrist"] + 1)
        vertices[grid[between]] = PchipInterpolator(at, np.stack(rings), axis=0)(between)
        # From the armhole the sleeve leaves along the shoulder at the top and along the arm at the bottom.
        axis = rings[int(np.searchsorted(places, 1.0))].mean(axis=0) - rings[0].mean(axis=0)
        axis = axis / np.linalg.norm(axis)
        reach = np.linalg.norm(rings[0] - hole, axis=1)[:, None]
        high = ((hole[:, 1] - hole[:, 1].min()) / max(np.ptp(hole[:, 1]), 1e-9))[:, None]
        seam = hole[half] - vertices[layout.lines[f"shoulder {side}"][0]]
        seam = seam / np.linalg.norm(seam)
        outward = np.array([np.sign(axis[0]), 0.0, 0.0])
        leave = high * (0.8 * seam + 0.2 * axis) + (1 - high) * (0.5 * axis + 0.5 * outward)
        leave = leave / np.linalg.norm(leave, axis=1, keepdims=True)
        t = (np.arange(1, rows["biceps"]) / rows["biceps"])[:, None, None]
        h00, h10 = 2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t
        h01, h11 = -2 * t**3 + 3 * t**2, t**3 - t**2
        vertices[grid[1 : rows["biceps"]]] = h00 * hole + h10 * reach * leave + h01 * rings[0] + h11 * reach * axis


def _set_neck(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    base = vertices[layout.neck[0]]
    s = arc_lengths(base, closed=True)
    top = resample(blueprint.collar, s[:-1] / s[-1], closed=True)
    rows = len(layout.neck) - 1
    t = (np.arange(1, rows + 1) / rows)[:, None, None]
    # Concave towards the shoulder: the neck leaves its base slanting inwards and ends upright.
    swing = 0.35 * (top.mean(axis=0) - base.mean(axis=0)) * (t - t**2)
    vertices[layout.neck[1:]] = (1 - t) * base + t * top + swing


def _set_sheet(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    """Set the vertices of chest, blades and shoulders: the smoothest sheet through the bounds that continues the bust's rows."""
    from scipy import sparse
    from scipy.sparse.linalg import factorized

    bust = layout.level_row["bust"]
    ids, laplacian, local = sheet_laplacian(layout, bust - 3)
    n = len(ids)
    known = ~np.isnan(vertices[ids, 0])
    bounds = np.zeros(n, bool)
    for name in QUARTERS:
        neckline, _, armhole, _, _ = _quarter_ids(layout, name)
        bounds[local[neckline]] = bounds[local[armhole]] = True
    bounds[local[layout.rings[bust - 3]]] = True
    operator = laplacian[~bounds]
    coarse = layout.resolution / 0.010
    guide_weight, attract_weight = _GUIDE * coarse**1.5, _ATTRACT * coarse**2
    guides, targets = _guides(vertices, layout, blueprint)
    guide = sparse.identity(n).tocsr()[local[guides]] * guide_weight
    free = np.flatnonzero(~known)
    pull = sparse.identity(n).tocsr()[free] * (attract_weight if blueprint.attract else 1e-6)
    matrix = sparse.vstack([operator, guide, pull]).tocsr()
    unknown, fixed = matrix[:, free], matrix[:, np.flatnonzero(known)]
    solve = factorized((unknown.T @ unknown).tocsc())
    constant = fixed @ vertices[ids[known]]
    position = np.zeros((len(free), 3))
    for round_ in range(1 + (_ATTRACT_ROUNDS if blueprint.attract else 0)):
        if round_ == 0:
            # The first sheet follows the guides alone: there is none yet to draw to the body.
            first = sparse.vstack([operator, guide * 5.0]).tocsr()
            u, f = first[:, free], first[:, np.flatnonzero(known)]
            right = (
                np.vstack([np.zeros((operator.shape[0], 3)), 5.0 * guide_weight * targets]) - f @ vertices[ids[known]]
            )
            position = factorized((u.T @ u).tocsc())(np.asarray(u.T @ right))
            continue
        assert blueprint.attract is not None
        drawn = blueprint.attract(position)
        right = np.vstack([np.zeros((operator.shape[0], 3)), 0.0 * targets, attract_weight * drawn]) - constant
        right[operator.shape[0] : operator.shape[0] + len(guides)] += guide_weight * targets
        position = solve(np.asarray(unknown.T @ right))
    vertices[ids[free]] = position


def _guides(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> tuple[IntArray, FloatArray]:
    """Return vertices of the across-chest rows and the centre lines above the bust, and where they should lie."""
    n0, n1, n2, _ = layout.columns
    ids: list[IntArray] = []
    places: list[FloatArray] = []
    for name in QUARTERS:
        c = blueprint.quarters[name]
        _, _, _, chest, centre = _quarter_ids(layout, name)
        # The princess line climbs straight up from the bust point as far as the row's width allows.
        point = vertices[layout.lines[f"princess {name.replace('-', ' ')}"][layout.level_row["bust"]], 0]
        princess = float(np.clip(0.97 * point / c.chest[-1, 0], 0.45, 0.68))
        row = _pieces(c.chest, [0.0, 0.5 * princess, princess, 1.0], [n0, n1, n2])
        ids.append(chest[:-1])
        places.append(row[:-1])
        if name.endswith("left"):
            rise = layout.level_row["chest"] - layout.level_row["bust"]
            s = arc_lengths(c.centre)
            at = s[np.argmin(np.linalg.norm(c.centre - c.chest[0], axis=1))] / s[-1]
            line = _pieces(c.centre, [0.0, float(at), 1.0], [rise, len(centre) - 1 - rise])
            inner = np.arange(1, len(centre) - 1)
            inner = inner[inner != rise]
            ids.append(centre[inner])
            places.append(line[inner])
    return np.concatenate(ids).astype(np.int32), np.concatenate(places)
