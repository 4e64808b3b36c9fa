"""Seams that the user draws, and those that he wants in any case.

Every way of drawing (places, a polyline, a plane, rows of vertices) becomes a path over the cloth, and its faces are split along it. All
are made before anything else is cut, in an order of their own: that in which they are given does not matter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, InputError, arc_lengths, points_at_lengths, project_on_segments, quote_value, unit
from warpflat.flat import Surface, SurfacePath, are_joined, geodesic_path, locate, polyline_path
from warpflat.garment.construction.meet import SAME_PLACE
from warpflat.garment.seams.anatomy import FROM_SHOULDERS, TAILORED, Anatomy
from warpflat.garment.seams.cloth import ISLAND, LEVELS, Cloth, are_among, edge_components, section
from warpflat.garment.seams.options import SeamCut, SeamOptions, in_family
from warpflat.garment.seams.section import plane_sections
from warpflat.garment.seams.tailor import BESIDE, LEFT, centre_lines

__all__ = ["HAND", "cut_by_hand", "join_ends", "keep_seams", "leave_to_hand", "level_of", "plane_curves"]

Ids = NDArray[np.int64]

#: Stands before the name of a seam that the user has drawn, as long as others are looked for.
HAND = "by hand: "

# Lengths are shares of the garment's size, the square root of its area.
# An end of a drawn seam so near to a border or another seam is carried on to it; one so little beyond another seam is left out.
_REACH = 0.015
# A seam that was found is left to a drawn one if this share of it runs beside that one.
_MOSTLY = 0.6
# Steps of a polyline over the cloth, in lengths of its edges.
_STEP = 3.0
# A yoke lies so far down from the shoulder to the armpit, or from the waist to the crotch.
_YOKE = 0.4


def cut_by_hand(
    cloths: Sequence[Cloth], surfaces: Sequence[Surface], cuts: Sequence[SeamCut]
) -> tuple[list[Cloth], list[str]]:
    """Return the layers of a garment with the user's seams, each under its name behind `HAND`, and notes.

    Args:
        cloths: the layers, uncut, their vertices those of the surfaces.
        surfaces: as they were read.
        cuts: the seams.

    Raises:
        InputError: a place is off the cloth, a plane misses it, a row leaves its edges, a line crosses itself, or no cut parts anything.
    """
    made, idle = list(cloths), list[str]()

    def canonical(cut: SeamCut) -> tuple[int, str]:
        ways = (cut.edges, cut.points, cut.line, cut.plane)
        numbers = [np.asarray(value, dtype=float).tolist() for way in ways for value in way or ()]
        # Rows of vertices come first: the vertices are still those of the file.
        return next(k for k, way in enumerate(ways) if way), repr((numbers, cut.towards, cut.nearest, cut.name))

    for cut in sorted(cuts, key=canonical):
        name, count = f"{HAND}{cut.name or 'cut'}", 0
        try:
            for layer, path in _paths(made, surfaces, cut):
                cloth, edges = (made[layer], path) if isinstance(path, np.ndarray) else made[layer].drawn(path)
                if len(edges):
                    cloth = cloth.with_seam(name, edges)
                made[layer], count = cloth, count + len(edges)
        except InputError as error:
            raise InputError(f"{cut.where}: {error}") from None
        if not count:
            idle.append(cut.where)
    words = "runs along the border or another cut, and parts nothing"
    if len(idle) == len(cuts) and cuts:
        raise InputError(f"{idle[0]}: {words}; draw it across the cloth")
    return made, [f"{where} {words}: it is left out" for where in idle]


def plane_curves(
    layers: Sequence[Surface], point: ArrayLike, normal: ArrayLike, *, towards: ArrayLike | None, nearest: bool
) -> list[tuple[int, SurfacePath]]:
    """Return the curves along which a plane cuts a garment, each with the number of its layer, without those of mere wrinkles.

    Args:
        layers: of the garment.
        point, normal: of the plane [m].
        towards: if given, only the half of the plane that lies in this direction from the point.
        nearest: whether only the curve nearest to the point is cut.

    Raises:
        InputError: the plane misses the garment.
    """
    origin, axis = np.asarray(point, dtype=float), unit(np.asarray(normal, dtype=float))
    found = [
        (layer, path)
        for layer, surface in enumerate(layers)
        for path in plane_sections(surface, origin, axis, towards=towards)
    ]
    if not found:
        reach = np.concatenate([surface.vertices for surface in layers]) @ axis
        side = "" if towards is None or not reach.min() <= origin @ axis <= reach.max() else " in that direction"
        raise InputError(
            f"the plane misses the garment{side}: along its normal that spans {reach.min():.4g} to {reach.max():.4g} m, and the plane "
            f"lies at {origin @ axis:.4g} m"
        )
    longest = max(path.length for _, path in found)
    found = [(layer, path) for layer, path in found if path.length >= ISLAND * longest]
    if not nearest:
        return found
    return [min(found, key=lambda one: float(np.linalg.norm(one[1].points - origin, axis=1).min()))]


def _paths(
    cloths: Sequence[Cloth], surfaces: Sequence[Surface], cut: SeamCut
) -> Iterator[tuple[int, SurfacePath | Ids]]:
    """Yield the paths of a cut, or its edges, each with the number of its layer; the layers may be cut in between."""
    if cut.edges:
        rows = [np.asarray(row, dtype=np.int64) for row in cut.edges]
        layers, lies = _owners(surfaces, rows)
        for layer in dict.fromkeys(layers):
            mine = [(row, own) for row, of, own in zip(rows, layers, lies, strict=True) if of == layer]
            asked = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row, _ in mine])
            edges = np.concatenate([np.stack([own[:-1], own[1:]], axis=1) for _, own in mine])
            # Vertices of the file at one place are one.
            asked, edges = asked[edges[:, 0] != edges[:, 1]], edges[edges[:, 0] != edges[:, 1]]
            broken = np.flatnonzero(~are_joined(cloths[layer].half_edges.edges, *edges.T))
            if len(broken):
                a, b = asked[broken[0]]
                raise InputError(f"no edge of the mesh joins vertices {a} and {b} (counted from 0)")
            yield layer, cloths[layer].new_edges(np.unique(np.sort(edges, axis=1), axis=0))
        return
    if cut.plane is not None:
        origin, normal = cut.plane
        uncut = [cloth.as_surface() for cloth in cloths]
        for layer, found in plane_curves(uncut, origin, normal, towards=cut.towards, nearest=cut.nearest):
            middle = found.points.mean(axis=0)
            now = plane_sections(cloths[layer].as_surface(), origin, normal, towards=cut.towards)
            yield layer, min(now, key=lambda path: float(np.linalg.norm(path.points.mean(axis=0) - middle)))
        return
    given = [np.asarray(place, dtype=float) for place in cut.points or cut.line if isinstance(place, Sequence)]
    numbered = [np.array([place], dtype=np.int64) for place in cut.points if not isinstance(place, Sequence)]
    whole = [cloth.as_surface() for cloth in cloths]
    off = np.array([[np.linalg.norm(_on(surface, point) - point) for point in given] for surface in whole])
    owners, own = _owners(surfaces, numbered) if numbered else ([], [])
    if len(set(owners)) > 1:
        raise InputError("its vertices lie on different parts of the garment, which no cut joins")
    layer = owners[0] if owners else int(off.sum(axis=1).argmin())
    surface = whole[layer]
    for point, away in zip(given, off[layer], strict=True):
        if away > BESIDE * cloths[layer].size:
            x, y, z = point.tolist()
            raise InputError(f"the point ({x:g}, {y:g}, {z:g}) lies {away:.3g} m off the garment; points are in metres")
    if cut.points:
        points, vertices = iter(given), iter(own)
        stops = [next(points) if isinstance(place, Sequence) else int(next(vertices)[0]) for place in cut.points]
        yield layer, polyline_path(surface, stops, closed=cut.closed)
        return
    edge = surface.vertices[cloths[layer].half_edges.edges]
    drawn = np.array([*given, given[0]] if cut.closed else given)
    length = arc_lengths(drawn)
    if length[-1] == 0.0:
        raise InputError("all points of its line are one place; a line has two or more")
    step = _STEP * float(np.linalg.norm(edge[:, 1] - edge[:, 0], axis=1).mean())
    # The corners of the line, and places between them.
    fine = [np.linspace(a, b, max(1, round(float(b - a) / step)), endpoint=False) for a, b in pairwise(length) if b > a]
    places = [_on(surface, point) for point in points_at_lengths(drawn, np.append(np.concatenate(fine), length[-1]))]
    # Neighbours that fall together, as where the line turns away from the cloth, are one.
    kept = places[:1]
    for place in places[1:]:
        if np.linalg.norm(place - kept[-1]) > 0.1 * step:
            kept.append(place)
    if cut.closed and np.linalg.norm(kept[0] - kept[-1]) <= 0.1 * step:
        kept.pop()
    yield layer, polyline_path(surface, kept, closed=cut.closed)


def _on(surface: Surface, point: FloatArray) -> FloatArray:
    """Return the point of a surface that is nearest to a point."""
    place = locate(surface, point)
    return np.asarray(sum(weight * surface.vertices[vertex] for vertex, weight in place.items()))


def _owners(surfaces: Sequence[Surface], rows: Sequence[Ids]) -> tuple[list[int], list[Ids]]:
    """Return for rows of vertices of the file the layer on which each lies, and its own vertices.

    Raises:
        InputError: there is no such vertex, or it lies on none of the layers.
    """
    wanted, of_row = np.unique(np.concatenate(rows), return_inverse=True)
    count = max(len(surface.input_vertices) for surface in surfaces)
    if wanted[-1] >= count:
        raise InputError(f"vertex {wanted[-1]} does not exist; the file has {count:,}, numbered from 0 to {count - 1}")
    places, exact = [], []
    for surface in surfaces:
        own = np.full(len(surface.input_vertices), -1, dtype=np.int64)
        own[surface.input_index[::-1]] = np.arange(len(surface.vertices))[::-1]
        place = own[wanted]
        exact.append(place >= 0)
        lost = np.flatnonzero(place < 0)
        if len(lost):
            # It was joined to another one at its place.
            away, near = cKDTree(surface.vertices).query(surface.input_vertices[wanted[lost]])
            place[lost] = np.where(away <= SAME_PLACE, near, -1)
        places.append(place)
    layers, found = list[int](), list[Ids]()
    for number in np.split(of_row.ravel(), np.cumsum([len(row) for row in rows])[:-1]):
        lies = [layer for layer, place in enumerate(places) if (place[number] >= 0).all()]
        if not lies:
            lost = number[np.max([place[number] for place in places], axis=0) < 0]
            gone = f": vertex {wanted[lost[0]]} (counted from 0) is not on it" if len(lost) else ""
            raise InputError(f"the row from vertex {wanted[number[0]]} is not on one part of the garment{gone}")
        layers.append(max(lies, key=lambda layer: int(exact[layer][number].sum())))
        found.append(places[layers[-1]][number])
    return layers, found


def join_ends(cloth: Cloth) -> tuple[Cloth, list[str]]:
    """Return the cloth with drawn seams that end near a border or another seam carried on to it, or back, and notes on ends inside."""
    size, notes = cloth.size, list[str]()
    tried = set[tuple[float, ...]]()
    while True:
        vertices, degree = np.unique(cloth.seam_edges(), return_counts=True)
        inside = vertices[(degree == 1) & ~np.isin(vertices, cloth.border_edges)]
        ends = [
            (tuple(cloth.vertices[vertex].tolist()), int(vertex), name)
            for name, edges in cloth.seams.items()
            if name.startswith(HAND)
            for vertex in np.intersect1d(edges, inside)
        ]
        ends = sorted(end for end in ends if end[0] not in tried)
        if not ends:
            return cloth, notes
        place, vertex, name = ends[0]
        tried.add(place)
        stub = next(
            line for line in edge_components(cloth.seams[name], ends=vertices[degree > 2]) if (line == vertex).any()
        )
        tip = cloth.vertices[stub]
        if (
            np.isin(stub, vertices[degree > 2]).any()
            and np.linalg.norm(tip[:, 1] - tip[:, 0], axis=1).sum() <= _REACH * size
        ):
            # It was drawn a little too far.
            rest = cloth.seams[name][~are_among(cloth.seams[name], stub)]
            cloth = replace(cloth, seams={**cloth.seams, name: rest})
            continue
        lines = edge_components(cloth.seam_edges())
        others = [cloth.border_edges, *(line for line in lines if not (line == vertex).any())]
        targets = np.concatenate(others)
        if not len(targets):
            continue
        start, stop = cloth.vertices[targets[:, 0]], cloth.vertices[targets[:, 1]]
        share, away = project_on_segments(np.array(place), start, stop)
        best = int(away.argmin())
        if away[best] <= _REACH * size:
            goal = start[best] + share[best] * (stop[best] - start[best])
            path = geodesic_path(cloth.as_surface(), vertex, goal)
            if path.length <= 2.0 * _REACH * size:
                cloth, edges = cloth.drawn(path)
                cloth = cloth.with_seam(name, edges)
                continue
        words = ", ".join(f"{100 * x:.0f}" for x in place)
        notes.append(
            f"{quote_value(name.removeprefix(HAND))} ends inside the cloth at ({words}) cm, {1e3 * away[best]:.0f} mm from the nearest "
            "border or seam: a dart"
        )


def leave_to_hand(cloth: Cloth, options: SeamOptions) -> tuple[Cloth, list[str]]:
    """Return the cloth without seams that were found where the user has drawn one, and notes: of the same name, or close beside it."""
    drawn = {name: edges for name, edges in cloth.seams.items() if name.startswith(HAND)}
    if not drawn:
        return cloth, []
    size, notes = cloth.size, list[str]()
    every = np.concatenate(list(drawn.values()))
    ends = cloth.vertices[every]
    steps = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(np.ceil(steps / (0.1 * BESIDE * size)).astype(np.int64), 1)
    of = np.repeat(np.arange(len(every)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    tree = cKDTree(ends[of, 0] + share[:, None] * (ends[of, 1] - ends[of, 0]))
    names = [name.removeprefix(HAND) for name in drawn]
    found = {name: edges for name, edges in cloth.seams.items() if name not in drawn}
    pieces = replace(cloth, seams=found).parts
    for name in found:
        kept = []
        for line in edge_components(found[name][~are_among(found[name], every)]):
            a, b = cloth.vertices[line].transpose(1, 0, 2)
            length = np.linalg.norm(b - a, axis=1)
            beside = float(length[tree.query(0.5 * (a + b))[0] <= BESIDE * size].sum()) >= _MOSTLY * float(length.sum())
            if beside and not options.keeps(name):
                # The pieces at both sides stay apart without it: most of each goes on in one of those that are left.
                he = cloth.half_edges
                sides = np.unique(pieces[he.face[are_among(he.edges, line)[he.edge]]])
                left = replace(
                    cloth, seams={**cloth.seams, name: cloth.seams[name][~are_among(cloth.seams[name], line)]}
                ).parts
                most = [
                    int(np.bincount(left[pieces == one], cloth.face_areas[pieces == one]).argmax()) for one in sides
                ]
                beside = len(set(most)) == len(most)
            if options.keeps(name) or not beside:
                kept.append(line)
        if any(in_family(name, own) for own in names):
            kept = []
        if sum(map(len, kept)) < len(cloth.seams[name]):
            notes.append(f"{name} is left to what you have drawn")
        cloth = cloth.without_seam(name)
        if kept:
            cloth = cloth.with_seam(name, np.concatenate(kept))
    return cloth, notes


def keep_seams(cloth: Cloth, anatomy: Anatomy, options: SeamOptions) -> tuple[Cloth, list[str]]:
    """Return the cloth with the seams that the user wants in any case, and a note on each that it cannot have.

    Shoulder, side, armhole, underarm and inseam are there where the garment has them. Centre lines, waist and yoke are made here: the
    zero line between left and right, and level lines where the trunk is narrowest, and below the shoulder or the waist.

    Args:
        cloth: cut by a tailor, with his fields.
        anatomy: of the garment.
        options: what is to be kept.
    """
    notes = list[str]()
    for name in options.keep:
        if any(in_family(seam.removeprefix(HAND), name) for seam in cloth.seams):
            continue
        kept = cloth.with_labels(sleeve=cloth.labels.get("sleeve", np.full(len(cloth.faces), -1, dtype=np.int64)))
        edges: Ids = np.empty((0, 2), dtype=np.int64)
        if name in ("centre front", "centre back") and LEFT in kept.values:
            kept, lines = centre_lines(kept)
            edges = kept.new_edges(lines[name])
        elif name in ("waist", "yoke") and (level := level_of(kept, anatomy, name, options)) is not None:
            kept, _, _, edges = kept.parted(kept.vertices @ anatomy.up - level, kept.labels["sleeve"] < 0)
            edges = kept.new_edges(edges)
        if len(edges):
            cloth = kept.with_seam(name, edges)
        else:
            notes.append(f"there is no {name} to keep: none was found in what is taken for: {anatomy.kind}")
    return cloth, notes


def level_of(cloth: Cloth, anatomy: Anatomy, name: str, options: SeamOptions) -> float | None:
    """Return the height of a waist or a yoke [m]; None where the garment has none."""
    if anatomy.kind not in (TAILORED if name == "yoke" else FROM_SHOULDERS):
        return None
    trunk = cloth.labels["sleeve"] < 0
    heights = cloth.vertices @ anatomy.up
    own = heights[np.unique(cloth.faces[trunk])]
    forks = {kind: [float(limb.fork @ anatomy.up) for limb in anatomy.limbs_of(kind)] for kind in ("sleeve", "leg")}
    low, high = float(own.min()), float(own.max())
    if name == "yoke":
        bottom = max(forks["sleeve"] or forks["leg"] or [0.5 * (low + high)])
        return high - _YOKE * (high - bottom)
    waist = options.waist_along(anatomy.up)
    if waist is not None and low < waist < high:
        return waist
    top = min(forks["sleeve"] or [high])
    bottom = max(forks["leg"] or [top - 0.75 * min(top - low, anatomy.size)])
    levels = np.linspace(top - 0.15 * (top - bottom), bottom + 0.15 * (top - bottom), LEVELS)
    girths = [section(cloth, heights - level, trunk)[0] for level in levels]
    return float(levels[int(np.argmin(girths))])
