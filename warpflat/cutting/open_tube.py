"""A tube, such as a sleeve or a skirt, is cut open before it is flattened."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.core.text import find_unused_name, quote_value
from warpflat.cutting.cut_plan import CutPlan, draw_line, line_part, make_cuts
from warpflat.surface.connectivity import border_loops
from warpflat.surface.mesh import Surface
from warpflat.surface.paths.edge_paths import EdgeGraph
from warpflat.surface.paths.trace import geodesic_path
from warpflat.surface.tubes import tube_borders

__all__ = ["open_tube"]


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
        surface = _cut(surface, line)
        if len(tube_borders(surface)) == len(borders):
            raise InputError(
                f"line {quote_value(line)} does not cut piece {surface.name!r} open; it must run from one border to another"
            )
    while borders := tube_borders(surface):
        start, end = _nearest_borders(surface, borders[0])
        name = find_unused_name("opening", {line.removesuffix(".left") for line in surface.lines})
        surface = _cut(draw_line(surface, name, geodesic_path(surface, start, end)), name)
    return surface


def _cut(surface: Surface, line: str) -> Surface:
    return make_cuts(surface, [CutPlan(name=line, paths=(line_part(surface, line),))]).surface


def _nearest_borders(surface: Surface, border: IntArray) -> tuple[int, int]:
    """Return the ends of the shortest path along edges from a border to any other."""
    from scipy.sparse.csgraph import dijkstra

    loops = border_loops(surface.faces)
    others = np.concatenate([loop for loop in loops if loop[0] not in border])
    graph = EdgeGraph(surface)
    far, _, source = dijkstra(graph.matrix(graph.length), indices=border, min_only=True, return_predecessors=True)
    end = int(others[np.argmin(far[others])])
    return int(source[end]), end
