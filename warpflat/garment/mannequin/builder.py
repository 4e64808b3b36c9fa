"""Laying the grid on a blueprint: rings by their profiles, the crotch curve and the legs, the shoulders as a smooth sheet."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from warpflat.core import FloatArray, IntArray, arc_lengths, polyline_length, resample, unit
from warpflat.garment.mannequin.blueprint import Blueprint, LegCurves, LegProfile, Profile
from warpflat.garment.mannequin.layout import LEG_LEVELS, QUARTERS, RING_LEVELS, Layout
from warpflat.garment.mannequin.profiles import convex_girth, scale_to_girth
from warpflat.garment.mannequin.sheet import fill_fork, fill_sheet, sheet_laplacian

__all__ = ["build_trunk", "build_vertices", "girth_ring", "quarter_fractions"]


# How strongly the sheet is drawn to the across-chest rows and centre lines, against one for its own smoothness, on a grid of 10 mm. The
# operator shrinks with the square of the edge, a curve's count of vertices with its inverse: hence the power by which it follows the
# resolution. And how often the sheet is drawn to a scan.
_GUIDE, _ATTRACT_ROUNDS = 0.01, 4
# Share of the neckline at which the yoke row starts.
_BEND = 0.52
# So far [m] below the underarm the bust's row meets the side, where the rows below it keep this share of the height: a dart
# from there keeps off the armhole.
_DART_ROOM, _LEAST_SHARE = 0.043, 0.2


def build_trunk(layout: Layout, blueprint: Blueprint) -> FloatArray:
    """Return the grid's vertices with the rings up to the bust and the legs in their places (layout.vertex_count by 3 [m]), others NaN."""
    vertices = np.full((layout.vertex_count, 3), np.nan)
    for low, high in itertools.pairwise(RING_LEVELS):
        first, last = layout.level_row[low], layout.level_row[high]
        for row in range(first, last + 1):
            share = (row - first) / (last - first)
            height = (1.0 - share) * blueprint.heights[low] + share * blueprint.heights[high]
            vertices[layout.rings[row]] = girth_ring(layout, blueprint.profile(height), height)
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
    # At the sides the rows from the underbust to the bust are lowered: a bust lies level with the armpits on many bodies, the
    # armhole ends below them, and a dart from the side needs room under it. A tape still reads each row's girth.
    first, bust, chest = (layout.level_row[level] for level in ("underbust", "bust", "chest"))
    base = vertices[layout.rings[: bust + 1]].copy()
    heights = base[:, 0, 1]
    quarter, count = layout.quarter, layout.rings.shape[1]
    reach = quarter - layout.to_princess
    for side, name in ((quarter, "front-left"), (3 * quarter, "front-right")):
        under = float(blueprint.quarters[name].armhole[-1, 1])
        even = heights[first] + (under - heights[first]) * (bust - first) / (chest - first)
        roomy = max(under - _DART_ROOM, heights[first] + _LEAST_SHARE * (under - heights[first]))
        top = min(heights[bust], even, roomy)
        for row in range(first + 1, bust + 1):
            dip = max(0.0, heights[row] - heights[first] - (top - heights[first]) * (row - first) / (bust - first))
            for column in range(side - reach + 1, side + reach):
                near = 1.0 - abs(column - side) / reach
                height = heights[row] - near * dip
                line = base[:, column % count]
                vertices[layout.rings[row, column % count]] = [np.interp(height, heights, line[:, k]) for k in range(3)]
    for row in range(first + 1, bust + 1):
        ring = layout.rings[row]
        vertices[ring] = scale_to_girth(vertices[ring], convex_girth(base[row]))
    # Neckline, shoulder seams and armholes.
    n0, n1, n2, n3 = layout.columns
    m2, m3 = len(layout.front) - 1, len(layout.yokes["front-left"]) - 1
    for name in QUARTERS:
        c = blueprint.quarters[name]
        vertices[_quarter_ids(layout, name)[0]] = _pieces(c.neckline, [0.0, _BEND, 1.0], [n0, m3])
    loop = layout.neck[0]
    vertices[loop] = _to_length(vertices[loop], blueprint.neck)
    for name in QUARTERS:
        c = blueprint.quarters[name]
        neckline, shoulder, armhole, _, _ = _quarter_ids(layout, name)
        seam = _pieces(c.shoulder, [0.0, 0.5, 1.0], [n1, n2])
        # The neck base was a little too short as a polygon; the seam's start follows it.
        follow = np.linspace(1.0, 0.0, len(seam))[:, None] * (vertices[neckline[-1]] - seam[0])
        vertices[shoulder] = seam + follow
        # The yoke row ends as far down the armhole as the neckline's bend lies below the shoulder seam, within what leaves
        # both strips of rows room.
        upper = c.notch * polyline_length(c.armhole)
        drop = (1.0 - _BEND) * polyline_length(c.neckline)
        yoke = c.notch * float(np.clip(0.9 * drop / max(upper, 1e-9), 0.22, 0.5))
        vertices[armhole] = _pieces(c.armhole, [0.0, yoke, c.notch, 1.0], [m3, m2, n3])
    # The side lines go straight on from the rows below the bust to the underarm points, without a kink.
    for column in (quarter, 3 * quarter):
        ids = layout.rings[bust : chest + 1, column]
        start, end = vertices[ids[0]], vertices[ids[-1]]
        along = start - vertices[layout.rings[bust - 3, column]]
        corner = start + 0.5 * np.linalg.norm(end - start) / np.linalg.norm(along) * along
        t = np.linspace(0.0, 1.0, len(ids))[1:-1, None]
        vertices[ids[1:-1]] = (1.0 - t) ** 2 * start + 2.0 * t * (1.0 - t) * corner + t**2 * end
    _set_arms(vertices, layout, blueprint)
    base = vertices[layout.neck[0]]
    s = arc_lengths(base, closed=True)
    top = resample(blueprint.collar, s[:-1] / s[-1], closed=True)
    rows = len(layout.neck) - 1
    t = (np.arange(1, rows + 1) / rows)[:, None, None]
    # Concave towards the shoulder: the neck leaves its base slanting inwards and ends upright.
    swing = 0.35 * (top.mean(axis=0) - base.mean(axis=0)) * (t - t**2)
    vertices[layout.neck[1:]] = (1 - t) * base + t * top + swing
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
    ends = (0.0, profile.side_left, profile.centre_back, profile.side_right, total)
    at: list[FloatArray] = []
    for i, name in enumerate(QUARTERS):
        shares = quarter_fractions(layout, profile.princess[name])
        if name in ("back-left", "front-right"):
            shares = 1.0 - shares[::-1]
        at.append(ends[i] + shares[:-1] * (ends[i + 1] - ends[i]))
    flat = resample(profile.curve, np.concatenate(at) / total, closed=True)
    row = np.column_stack([flat[:, 0], np.full(len(flat), height), flat[:, 1]])
    return scale_to_girth(row, profile.girth)


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


def _to_length(loop: FloatArray, length: float) -> FloatArray:
    """Return a closed polygon, #P by 3, blown up about its middle until it is `length` [m] long."""
    middle = loop.mean(axis=0)
    return middle + (loop - middle) * (length / polyline_length(loop, closed=True))


def _set_arms(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    from scipy.interpolate import PchipInterpolator

    for side, grid in layout.arms.items():
        curves = blueprint.arms[side]
        hole = vertices[grid[0]]
        # Columns keep the places they have on the armhole, by arc, from the underarm over the front to the top.
        half = grid.shape[1] // 2
        s = arc_lengths(hole, closed=True)
        shares = np.where(
            np.arange(len(hole)) <= half, 0.5 * s[:-1] / s[half], 0.5 + 0.5 * (s[:-1] - s[half]) / (s[-1] - s[half])
        )
        even = np.arange(len(hole)) / len(hole)
        places = np.array(list(curves))
        evened = np.interp(places, [0.0, 1.0, 2.0], [0.5, 0.8, 1.0])
        rings = [
            _to_length(resample(loop, w * even + (1 - w) * shares, closed=True), polyline_length(loop, closed=True))
            for loop, w in zip(curves.values(), evened, strict=True)
        ]
        rows = layout.arm_row
        at = np.interp(places, [0.0, 1.0, 2.0], [rows["biceps"], rows["elbow"], rows["wrist"]])
        between = np.arange(rows["biceps"], rows["wrist"] + 1)
        vertices[grid[between]] = PchipInterpolator(at, np.stack(rings), axis=0)(between)
        # From the armhole the sleeve leaves along the shoulder at the top and along the arm at the bottom.
        axis = unit(rings[int(np.searchsorted(places, 1.0))].mean(axis=0) - rings[0].mean(axis=0))
        reach = np.linalg.norm(rings[0] - hole, axis=1)[:, None]
        high = ((hole[:, 1] - hole[:, 1].min()) / max(np.ptp(hole[:, 1]), 1e-9))[:, None]
        seam = unit(hole[half] - vertices[layout.lines[f"shoulder {side}"][0]])
        outward = np.array([np.sign(axis[0]), 0.0, 0.0])
        leave = unit(high * (0.8 * seam + 0.2 * axis) + (1 - high) * (0.5 * axis + 0.5 * outward))
        t = (np.arange(1, rows["biceps"]) / rows["biceps"])[:, None, None]
        h00, h10 = 2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t
        h01, h11 = -2 * t**3 + 3 * t**2, t**3 - t**2
        vertices[grid[1 : rows["biceps"]]] = h00 * hole + h10 * reach * leave + h01 * rings[0] + h11 * reach * axis


def _set_sheet(vertices: FloatArray, layout: Layout, blueprint: Blueprint) -> None:
    """Set the vertices of chest, blades and shoulders: the smoothest sheet through the bounds that continues the bust's rows."""
    from scipy import sparse

    bust = layout.level_row["bust"]
    ids, laplacian, local = sheet_laplacian(layout, bust - 3)
    known = ~np.isnan(vertices[ids, 0])
    bounds = np.zeros(len(ids), bool)
    # The across-chest rows and the centre lines above the bust guide the sheet.
    n0, n1, n2, _ = layout.columns
    guides, targets = list[IntArray](), list[FloatArray]()
    for name in QUARTERS:
        c = blueprint.quarters[name]
        neckline, _, armhole, chest, centre = _quarter_ids(layout, name)
        bounds[local[neckline]] = bounds[local[armhole]] = True
        # The princess line climbs straight up from the bust point as far as the row's width allows.
        point = vertices[layout.lines[f"princess {name.replace('-', ' ')}"][bust], 0]
        princess = float(np.clip(0.97 * point / c.chest[-1, 0], 0.45, 0.68))
        guides.append(chest[:-1])
        targets.append(_pieces(c.chest, [0.0, 0.5 * princess, princess, 1.0], [n0, n1, n2])[:-1])
        if name.endswith("left"):
            rise, s = layout.level_row["chest"] - bust, arc_lengths(c.centre)
            at = s[np.argmin(np.linalg.norm(c.centre - c.chest[0], axis=1))] / s[-1]
            line = _pieces(c.centre, [0.0, float(at), 1.0], [rise, len(centre) - 1 - rise])
            inner = np.arange(1, len(centre) - 1)
            inner = inner[inner != rise]
            guides.append(centre[inner])
            targets.append(line[inner])
    bounds[local[layout.rings[bust - 3]]] = True
    operator, free = laplacian[~bounds], np.flatnonzero(~known)
    weight = _GUIDE * (layout.resolution / 0.010) ** 1.5

    def guided(weight: float) -> tuple[Any, FloatArray]:
        guide = weight * sparse.identity(len(ids)).tocsr()[local[np.concatenate(guides)]]
        target = np.vstack([np.zeros((operator.shape[0], 3)), weight * np.concatenate(targets)])
        return sparse.vstack([operator, guide]), target

    # The first sheet follows the guides alone: there is none yet to draw to the body.
    matrix, target = guided(5.0 * weight)
    fill_sheet(vertices, layout, ids, matrix, free, target=target)
    if blueprint.attract is not None:
        matrix, target = guided(weight)
        fill_sheet(
            vertices, layout, ids, matrix, free, target=target, attract=blueprint.attract, rounds=_ATTRACT_ROUNDS
        )


def set_legs(vertices: FloatArray, layout: Layout, legs: LegCurves) -> None:
    """Set the vertices of crotch curve and legs; those of the rings are there.

    Args:
        vertices: layout.vertex_count by 3 [m], changed in place.
        layout: the grid.
        legs: the curves.
    """
    point, cells = layout.crotch_point, len(layout.crotch) - 1
    shares = [np.linspace(0.0, legs.point, point + 1), np.linspace(legs.point, 1.0, cells - point + 1)[1:]]
    curve = resample(legs.crotch, np.concatenate(shares))
    # The curve was drawn to a profile; its ends follow the finished row.
    ends = vertices[layout.crotch[[0, -1]]] - curve[[0, -1]]
    along = np.linspace(0.0, 1.0, len(curve))[:, None]
    vertices[layout.crotch[1:-1]] = (curve + (1.0 - along) * ends[0] + along * ends[1])[1:-1]
    for side, grid in layout.legs.items():
        rows = layout.leg_row
        for high, low in itertools.pairwise(LEG_LEVELS[1:]):
            for row in range(rows[high], rows[low] + 1):
                share = (row - rows[high]) / (rows[low] - rows[high])
                height = (1.0 - share) * legs.heights[high] + share * legs.heights[low]
                vertices[grid[row]] = leg_ring(layout, legs.profile(side, height), height)
    fill_fork(vertices, layout, legs.attract)


def leg_ring(layout: Layout, profile: LegProfile, height: float) -> FloatArray:
    """Return one closed row of a leg, #columns by 3 [m]; a tape around it reads exactly the profile's girth."""
    inner, outer = layout.to_outseam - layout.quarter + layout.to_princess, layout.quarter - layout.to_princess
    back = len(layout.crotch) - 1 - layout.crotch_point + layout.to_princess
    a, b, c = 0.5 * profile.outseam, profile.outseam, 0.5 * (1.0 + profile.outseam)
    # Next to the inseam the columns keep the wider spacing that they have on the crotch curve.
    near, far = _widened(inner, profile.spread), 1.0 - _widened(back, profile.spread)[::-1]
    shares = [
        a * near[:-1],
        np.linspace(a, b, outer, endpoint=False),
        np.linspace(b, c, outer, endpoint=False),
        c + (1.0 - c) * far[:-1],
    ]
    flat = resample(profile.curve, np.concatenate(shares), closed=True)
    return scale_to_girth(np.column_stack([flat[:, 0], np.full(len(flat), height), flat[:, 1]]), profile.girth)


def _widened(cells: int, spread: float) -> FloatArray:
    """Return `cells` + 1 shares from 0 to 1, the first steps 1 + `spread` times the mean one and the last 1 - `spread` times."""
    u = np.linspace(0.0, 1.0, cells + 1)
    return (1.0 + spread) * u - spread * u * u
