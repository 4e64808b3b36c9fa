"""A tube, such as a sleeve or a skirt, is cut open before it is flattened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warpflat.core.errors import InputError
from warpflat.core.text import find_unused_name, quote_value
from warpflat.flat.cutting.cut_plan import CutPlan, line_part, make_cuts
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.cut.split_faces import split_faces_along
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import EdgeGraph
from warpflat.flat.surface.paths.trace import geodesic_path
from warpflat.flat.surface.tubes import tube_borders

__all__ = ["draw_openings", "open_tube"]


def open_tube(surface: Surface, line: str | None = None) -> Surface:
    """Cut a tube open, so that it can lie flat; its two sides are a seam of the pattern.

    Args:
        surface: a tube, such as a sleeve, a skirt or a trouser leg; with more than two borders it is cut more than once.
        line: a feature line of it from border to border; without one it is cut where borders are nearest to each other, along a
            geodesic, which is drawn as the line "opening".

    Returns:
        The surface, the vertices of the cut doubled.

    Raises:
        InputError: it is no tube, there is no such line, or the line does not cut it open.
    """
    borders = tube_borders(surface)
    if not borders:
        raise InputError(f"piece {surface.name!r} is no tube: no second border runs around it; it needs no opening")
    if line is not None:
        surface = make_cuts(surface, [CutPlan(name=line, paths=(line_part(surface, line),))]).surface
        if len(tube_borders(surface)) == len(borders):
            raise InputError(
                f"line {quote_value(line)} does not cut piece {surface.name!r} open; it must run from one border to another"
            )
    drawn, openings = draw_openings(surface, ())
    return make_cuts(drawn, openings).surface


def draw_openings(surface: Surface, plans: Sequence[CutPlan]) -> tuple[Surface, list[CutPlan]]:
    """Draw lines along which a surface with cuts is to be opened, where its borders are nearest to each other; none crosses a cut.

    Args:
        surface: with the paths of all cuts along its edges; vertices of these stay as they are.
        plans: the cuts.

    Returns:
        The surface, uncut, with the lines "opening", "opening 2" and so on; the cuts along these.
    """
    from scipy.sparse.csgraph import dijkstra

    whole, openings = surface, list[CutPlan]()
    made = make_cuts(surface, plans)
    cut = made.surface
    origin = np.arange(len(surface.vertices)) if made.cut is None else made.cut.vertex_origin.astype(np.int64)
    while borders := tube_borders(cut):
        name = find_unused_name("opening", {line.removesuffix(".left") for line in whole.lines})
        # The ends of the shortest path along edges from a border to any other.
        loops = border_loops(cut.faces)
        others = np.concatenate([loop for loop in loops if loop[0] not in borders[0]])
        graph = EdgeGraph(cut)
        far, _, source = dijkstra(
            graph.matrix(graph.length), indices=borders[0], min_only=True, return_predecessors=True
        )
        end = int(others[np.argmin(far[others])])
        path = geodesic_path(cut, int(source[end]), end)
        # The part of the path from where it leaves one border to where it reaches the next.
        of = {vertex: number for number, loop in enumerate(loops) for vertex in loop.tolist()}
        at = [of.get(place[0], -1) if place[1] < 0 else -1 for place in path.support.tolist()]
        end = next(index for index, loop in enumerate(at) if loop >= 0 and loop != at[0])
        start = max(index for index in range(end) if at[index] >= 0)
        part = slice(start, end + 1)
        path = replace(path, support=path.support[part], weights=path.weights[part], points=path.points[part])
        split = split_faces_along(cut, path)
        new = np.arange(len(cut.vertices), len(split.surface.vertices))
        # New vertices lie inside the cut surface: beside a cut there are none, and its sides can be closed again.
        origin = np.append(origin, len(whole.vertices) + np.arange(len(new)))
        between: dict[tuple[int, int], list[tuple[float, int]]] = {}
        for vertex in new.tolist():
            ends = [
                (int(origin[v]), w)
                for v, w in zip(split.vertex_support[vertex], split.vertex_weights[vertex], strict=True)
                if v >= 0
            ]
            if len(ends) == 2:
                (low, _), (high, share) = sorted(ends)
                between.setdefault((low, high), []).append((share, int(origin[vertex])))
        faces = split.surface.faces
        lines = {}
        for key, line in whole.lines.items():
            vertices = line[:1].tolist()
            for a, b in pairwise(line.tolist()):
                found = [vertex for _, vertex in sorted(between.get((min(a, b), max(a, b)), []))]
                vertices += [*(found if a < b else found[::-1]), b]
            lines[key] = np.array(vertices, dtype=np.int32)
        whole = replace(
            split.surface,
            vertices=np.concatenate([whole.vertices, split.surface.vertices[new]]),
            input_index=np.concatenate([whole.input_index, split.surface.input_index[new]]),
            faces=np.where(faces >= 0, origin[faces], -1).astype(np.int32),
            lines={**lines, name: origin[split.path].astype(np.int32)},
            of_faces={},
        )
        openings.append(CutPlan(name=name, paths=(whole.lines[name],)))
        made = make_cuts(split.surface, [CutPlan(name=name, paths=(split.path,))])
        assert made.cut is not None
        cut, origin = made.surface, origin[made.cut.vertex_origin]
    return whole, openings
