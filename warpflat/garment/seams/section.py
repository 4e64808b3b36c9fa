"""Plane sections of a surface: straight cuts, level, upright or slanted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, InputError, IntArray, project_on_segments
from warpflat.flat import (
    Place,
    Surface,
    SurfacePath,
    VertexStar,
    describe_place,
    locate,
    make_path,
    path_triangles,
    simplify_places,
)

__all__ = ["plane_path", "plane_section", "plane_sections"]


def plane_section(surface: Surface, point: ArrayLike, normal: ArrayLike) -> SurfacePath:
    """Return the curve in which a plane meets the surface, from border to border or closed; of several the nearest to the point.

    Args:
        surface: the surface.
        point: of the plane [m]; it need not lie on the surface.
        normal: of the plane, any length but zero.

    Raises:
        InputError: for a normal of zero, or a plane that does not cut the surface.
    """
    axis, origin = _direction(normal, "a plane's normal"), np.asarray(point, dtype=float)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise InputError(f"a plane's point is three finite numbers [m], got {point!r}")
    found = _nearest_curve(surface, origin, axis, path_triangles(surface)[0])
    if found is None:
        reach = surface.vertices @ axis
        raise InputError(
            f"the plane does not cut the piece {surface.name!r}: along its normal the piece spans {reach.min():.4g} to "
            f"{reach.max():.4g} m and the plane lies at {origin @ axis:.4g} m"
        )
    _, places, closed = found
    return make_path(surface, places, closed=closed)


def plane_sections(
    surface: Surface, point: ArrayLike, normal: ArrayLike, *, towards: ArrayLike | None = None
) -> list[SurfacePath]:
    """Return all curves in which a plane meets the surface, from border to border or closed; none where it misses.

    Args:
        surface: the surface.
        point: of the plane [m]; it need not lie on the surface.
        normal: of the plane, any length but zero.
        towards: if given, only what lies in this direction from the point: the curves of half a plane.

    Raises:
        InputError: for a direction of zero.
    """
    axis, origin = _direction(normal, "a plane's normal"), np.asarray(point, dtype=float)
    paths = [
        make_path(surface, places, closed=closed)
        for places, closed in _curves(surface, origin, axis, path_triangles(surface)[0])
    ]
    if towards is None:
        return paths
    ahead = _direction(towards, "`towards`")
    found = []
    for path in paths:
        row = [path.place(number) for number in range(len(path.points))]
        along = (path.points - origin) @ ahead
        if path.closed and (along < 0.0).any() and (along >= 0.0).any():
            # From a point behind, so that no run goes on over the end.
            first = int(along.argmin())
            row, along = [*row[first:], *row[: first + 1]], np.concatenate([along[first:], along[: first + 1]])
        elif path.closed:
            found += [path] if (along >= 0.0).all() else []
            continue
        runs: list[list[Place]] = [[]]
        for number, place in enumerate(row):
            if number and (along[number - 1] >= 0.0) != (along[number] >= 0.0):
                share = along[number - 1] / (along[number - 1] - along[number])
                edge = {v: (1.0 - share) * w for v, w in row[number - 1].items()}
                for v, w in place.items():
                    edge[v] = edge.get(v, 0.0) + share * w
                runs[-1].append({v: w for v, w in edge.items() if w > 0.0})
                if along[number] < 0.0:
                    runs.append([])
            if along[number] >= 0.0:
                runs[-1].append(place)
        found += [make_path(surface, simplify_places(run)) for run in runs if len(run) > 1]
    return [path for path in found if path.length > 0.0]


def plane_path(
    surface: Surface, point: ArrayLike | int, normal: ArrayLike, *, towards: ArrayLike | None = None
) -> SurfacePath:
    """Return the curve through a point in which a plane through that point meets the surface.

    Args:
        surface: the surface.
        point: a vertex index or a position [m]; the plane goes through the nearest point of the surface.
        normal: of the plane, any length but zero.
        towards: if given, only the part from the point in this direction as far as the border.

    Returns:
        The curve from border to border, or closed. With `towards` it runs from the border inwards to the point, as a
        dart does.

    Raises:
        InputError: for a normal of zero, a plane that only touches the surface at the point, or a `towards` that leads
            along a closed curve and so to no border.
    """
    axis = _direction(normal, "a plane's normal")
    start = locate(surface, point)
    origin = np.sum([weight * surface.vertices[v] for v, weight in start.items()], axis=0)
    triangles, _ = path_triangles(surface)
    best = _nearest_curve(surface, origin, axis, triangles)
    if best is None or best[0] > 1e-6 * np.ptp(surface.vertices, axis=0).max():
        raise InputError(f"the plane only touches the surface at {describe_place(start)}; turn its normal")
    _, places, closed = best
    if towards is None:
        return make_path(surface, places, closed=closed)
    if closed:
        raise InputError("the plane's curve is closed and reaches no border; leave `towards` out to cut all round")
    # The half of the row that leaves `start` towards the direction, reversed, so that it ends at `start`.
    inwards = _direction(towards, "`towards`")
    segment = int(np.argmin(_distances(surface, places, False, origin)))
    points = make_path(surface, places).points
    # A start on a vertex or edge is itself one of the places, up to rounding.
    near = [i for i in (segment, segment + 1) if places[i].keys() == start.keys()]
    before = places[: near[0] if near else segment + 1]
    after = places[near[0] + 1 :] if near else places[segment + 1 :]
    options = [side for side in (before, after[::-1]) if side]
    if not options:
        raise InputError(f"the plane's curve has no part beside {describe_place(start)}")

    def lead(side: list[Place]) -> float:
        step = np.sum([weight * surface.vertices[v] for v, weight in side[-1].items()], axis=0) - origin
        return float(step @ inwards / max(float(np.linalg.norm(step)), np.finfo(float).tiny))

    chosen = max(options, key=lead)
    if lead(chosen) <= 0 or len(points) < 2:
        raise InputError(
            f"from {describe_place(start)} the plane's curve does not lead towards {inwards.round(3).tolist()}"
        )
    path = simplify_places([*chosen, start])
    if not VertexStar(triangles).sharing([*path[-2], *path[-1]]):
        raise InputError(f"the plane's curve passes {describe_place(start)} without meeting it; choose another point")
    return make_path(surface, path)


def _nearest_curve(
    surface: Surface, origin: FloatArray, axis: FloatArray, triangles: IntArray
) -> tuple[float, list[Place], bool] | None:
    """Return the nearest to the plane's origin of the curves in which it meets the surface: distance [m], places, whether closed."""
    best: tuple[float, list[Place], bool] | None = None
    for places, closed in _curves(surface, origin, axis, triangles):
        gap = _distances(surface, places, closed, origin).min()
        if best is None or gap < best[0]:
            best = gap, places, closed
    return best


def _curves(
    surface: Surface, origin: FloatArray, axis: FloatArray, triangles: IntArray
) -> Iterator[tuple[list[Place], bool]]:
    """Yield the curves in which a plane meets the surface: places, and whether the curve is closed."""
    height = (surface.vertices - origin) @ axis
    # A vertex in the plane counts as above it: each triangle is then crossed in two of its edges or in none. Heights of
    # rounding size must be exactly 0, or the curve would pass by a vertex instead of through it.
    height[np.abs(height) < 1e-10 * np.ptp(surface.vertices, axis=0).max()] = 0.0
    above = height >= 0
    crossed = triangles[above[triangles].any(axis=1) & ~above[triangles].all(axis=1)]
    # The two crossed edges of each triangle, as (upper, lower) vertex, and the triangles at each crossed edge.
    edges_of: list[list[tuple[int, int]]] = []
    triangles_at: dict[tuple[int, int], list[int]] = {}
    for index, (a, b, c) in enumerate(crossed.tolist()):
        pair = [(u, v) if above[u] else (v, u) for u, v in ((a, b), (b, c), (c, a)) if above[u] != above[v]]
        edges_of.append(pair)
        for edge in pair:
            triangles_at.setdefault(edge, []).append(index)
    # Chains of edges run from border to border, or around.
    chains = []
    left = set(triangles_at)
    ends = [edge for edge, found in triangles_at.items() if len(found) == 1]
    for seed in [*ends, *triangles_at]:
        if seed in left:
            chain, here, came = [seed], seed, -1
            left.discard(seed)
            while onward := [t for t in triangles_at[here] if t != came]:
                came = onward[0]
                here = next(edge for edge in edges_of[came] if edge != here)
                if here not in left:
                    break
                left.discard(here)
                chain.append(here)
            chains.append((chain, len(triangles_at[seed]) > 1))
    for chain, closed in chains:
        # The first end of each edge lies above the plane, or in it, and the second below.
        shares = [float(height[a] / (height[a] - height[b])) for a, b in chain]
        crossings = [{a: 1.0 - t, b: t} if t > 0.0 else {a: 1.0} for (a, b), t in zip(chain, shares, strict=True)]
        places = simplify_places(crossings)
        if closed and len(places) > 1 and places[0] == places[-1]:
            places.pop()
        if len(places) >= 2:
            yield places, closed


def _direction(value: ArrayLike, what: str) -> FloatArray:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise InputError(f"{what} is three finite numbers, not all zero, got {value!r}")
    return vector / np.linalg.norm(vector)


def _distances(surface: Surface, places: list[Place], closed: bool, origin: FloatArray) -> FloatArray:
    """Return the distance [m] from a point to each segment of a row of places."""
    points = make_path(surface, places).points
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    return project_on_segments(origin, points[: len(ends)], ends)[1]
