"""Seams of a form: stretches of edges that two pieces share on the mannequin."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import IntArray
from warpflat.garment.mannequin.pieces import FormPiece
from warpflat.garment.mannequin.seam_names import name_seams
from warpflat.pattern import unnumbered

__all__ = ["FormSeam", "SeamRun", "find_seams"]

#: A segment of an edge: names of piece and edge, and the segment's number in it.
_Place = tuple[str, str, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamRun:
    """A stretch of a seam along one edge on each side.

    Attributes:
        edges: names of the two edges.
        spans: the first and the last point of the stretch along each of them.
        against: whether the second edge runs against the first one.
        vertices: vertex indices of the two pieces along the stretch, in corresponding order.
    """

    edges: tuple[str, str]
    spans: tuple[tuple[int, int], tuple[int, int]]
    against: bool
    vertices: tuple[IntArray, IntArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class FormSeam:
    """Two edges (or parts of edges) that are sewn together: the same curve in space.

    Attributes:
        name: after the feature line, and where others are called so, the pieces: see `seam_names.name_seams`.
        pieces: names of the two pieces; the same twice where one piece is sewn to itself.
        edges: names of the two whole edges, as they are called without darts.
        runs: the stretches of the seam in their order; one, unless darts interrupt it.
    """

    name: str
    pieces: tuple[str, str]
    edges: tuple[str, str]
    runs: tuple[SeamRun, ...]


def find_seams(pieces: Mapping[str, FormPiece]) -> tuple[FormSeam, ...]:
    """Return the seams between pieces, and of pieces with themselves.

    A seam that darts interrupt is one seam of several runs. The legs of darts belong to none.
    """
    places: dict[tuple[int, int], list[_Place]] = {}
    for name, piece in pieces.items():
        legs = piece.leg_edges
        for edge, ids in piece.edges.items():
            if edge in legs:
                continue
            for i, (a, b) in enumerate(itertools.pairwise(piece.grid_vertices[ids].tolist())):
                places.setdefault((min(a, b), max(a, b)), []).append((name, edge, i))
    # In the order of the first sides.
    pairs = {sides[0]: sides[1] for sides in places.values() if len(sides) == 2}
    runs: list[tuple[tuple[str, str], SeamRun]] = []
    row: list[tuple[_Place, _Place]] = []
    for name, piece in pieces.items():
        for edge, ids in piece.edges.items():
            for i in range(len(ids) - 1):
                here = (name, edge, i)
                other = pairs.get(here)
                # A run goes on while its segments follow each other along the same two edges.
                last = row[-1] if row else None
                goes_on = (
                    last is not None
                    and other is not None
                    and (here[:2], other[:2]) == (last[0][:2], last[1][:2])
                    and abs(other[2] - last[1][2]) == 1
                )
                if row and not goes_on:
                    runs.append(_run(pieces, row))
                    row = []
                if other is not None:
                    row.append((here, other))
    if row:
        runs.append(_run(pieces, row))
    of_edges: dict[tuple[str, str, str, str], list[SeamRun]] = {}
    for names, run in runs:
        whole = [pieces[name].whole(edge) for name, edge in zip(names, run.edges, strict=True)]
        of_edges.setdefault((names[0], names[1], whole[0], whole[1]), []).append(run)
    # Runs that follow each other on the mannequin are one seam; what lies between them is closed darts.
    rows: list[tuple[tuple[str, str, str, str], tuple[SeamRun, ...]]] = []
    for sides, alike in of_edges.items():
        on_grid = pieces[sides[0]].grid_vertices
        ends = [[int(on_grid[run.vertices[0][at]]) for at in (0, -1)] for run in alike]
        follower = {start: number for number, (start, _) in enumerate(ends)}
        later = {follower[end] for _, end in ends if end in follower}
        done: set[int] = set()
        # A closed ring of runs has no first one: it begins anywhere.
        for number in [*(n for n in range(len(alike)) if n not in later), *range(len(alike))]:
            chain: list[SeamRun] = []
            at: int | None = number
            while at is not None and at not in done:
                done.add(at)
                chain.append(alike[at])
                at = follower.get(ends[at][1])
            if chain:
                rows.append((sides, tuple(chain)))
    called = name_seams(
        [unnumbered(edge) for (_, _, edge, _), _ in rows],
        [(first, second) for (first, second, _, _), _ in rows],
        [pieces[first].surface.vertices[np.concatenate([run.vertices[0] for run in chain])]
         for (first, _, _, _), chain in rows],
    )  # fmt: skip
    return tuple(
        FormSeam(name=name, pieces=(first, second), edges=(edge, other), runs=chain)
        for name, ((first, second, edge, other), chain) in zip(called, rows, strict=True)
    )


def _run(pieces: Mapping[str, FormPiece], row: Sequence[tuple[_Place, _Place]]) -> tuple[tuple[str, str], SeamRun]:
    names, edges, spans, sides = list[str](), list[str](), list[tuple[int, int]](), list[IntArray]()
    for side in (0, 1):
        at = [places[side][2] for places in row]
        names.append(row[0][side][0])
        edges.append(row[0][side][1])
        spans.append((min(at), max(at) + 1))
        sides.append(pieces[names[-1]].edges[edges[-1]][spans[-1][0] : spans[-1][1] + 1])
    first, second = (int(pieces[name].grid_vertices[ids[0]]) for name, ids in zip(names, sides, strict=True))
    against = first != second
    return (names[0], names[1]), SeamRun(
        edges=(edges[0], edges[1]),
        spans=(spans[0], spans[1]),
        against=against,
        vertices=(sides[0], sides[1][::-1] if against else sides[1]),
    )
