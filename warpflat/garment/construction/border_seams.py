"""Seams between two named lines on the border of one surface: found, checked and matched vertex by vertex.

The vertices of the two sides need not agree. Sides with equal numbers of vertices at equal shares of their length are sewn edge
by edge. Otherwise each vertex of the side with fewer is matched by arc length to the nearest of the other side, and between
two such joints both sides stretch evenly.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest, project_on_segments
from warpflat.flat import Surface, border_loops
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.sewn import Stitching

__all__ = ["ONE_CURVE", "surface_seams"]

#: Borders that keep this near [m] to each other in space are one curve.
ONE_CURVE = 1e-3
#: Other sides differ in length by no more than these shares: any, and those with as many vertices.
_ALIKE, _AS_MANY = 0.01, 0.05
#: Vertices that agree in their share of the length within this part of an edge are sewn edge by edge.
_SAME_SHARE = 0.01


def surface_seams(surface: Surface, named: Sequence[SeamTable]) -> list[Stitching]:
    """Return the seams that are named on a surface, in their order, as they are to be sewn.

    Args:
        surface: whole or cut, with the lines that the seams name.
        named: the seams.

    Raises:
        InputError: a line is unknown (names the nearest), closed, parted by a cut or not on the border, or the two do not
            fit: they share no curve in space and differ in length.
    """
    loops = border_loops(surface.faces)
    along = {edge for loop in loops for edge in pairwise([*loop.tolist(), int(loop[0])])}
    found = []
    for seam in named:
        try:
            sides = [_side(surface, along, line) for line in seam.lines]
            first, second = sides
            if len(np.intersect1d(first, second)) > 1:
                raise InputError(
                    f"lines {seam.lines[0]!r} and {seam.lines[1]!r} overlap; a side is sewn to another one"
                )
            one, other = surface.vertices[first], surface.vertices[second]
            # Two stretches of one border meet running against each other.
            second, other = second[::-1].copy(), other[::-1]
            shared = max(_largest_distance(one, other), _largest_distance(other, one)) <= ONE_CURVE
            if shared and np.linalg.norm(one[0] - other[-1]) < np.linalg.norm(one[0] - other[0]):
                raise InputError(
                    f"{seam.lines[0]!r} and {seam.lines[1]!r} lie on each other the same way round, face to back; sides meet face to face"
                )
            arcs = [arc_lengths(points) for points in (one, other)]
            lengths = [float(arc[-1]) for arc in arcs]
            unlike = abs(lengths[0] - lengths[1]) / max(lengths)
            if not shared and unlike > (_AS_MANY if len(first) == len(second) else _ALIKE):
                raise InputError(
                    f"{seam.lines[0]!r} is {1e3 * lengths[0]:.1f} mm long and {seam.lines[1]!r} {1e3 * lengths[1]:.1f} mm, and they are "
                    f"not one curve in space; sides agree within {_ALIKE:.0%}, or {_AS_MANY:.0%} with as many vertices each"
                )
            # Joined are all vertices, one to one, or those whose shares of the length are the nearest.
            shares = [arc / length for arc, length in zip(arcs, lengths, strict=True)]
            joints: IntArray | None = None
            if (
                len(first) != len(second)
                or not np.abs(shares[0] - shares[1]).max() <= _SAME_SHARE * np.diff(shares[0]).min()
            ):
                swapped = len(first) > len(second)
                coarse, fine = shares[::-1] if swapped else shares
                place = np.abs(fine[None, :] - coarse[:, None]).argmin(axis=1)
                place[0], place[-1] = 0, len(fine) - 1
                keep = np.append(np.diff(place) > 0, True)
                keep[0] = True
                pairs = np.column_stack([np.flatnonzero(keep), place[keep]])
                # The first joint is kept for good: one that falls onto it again goes.
                pairs = pairs[np.append(True, np.diff(pairs[:, 1]) > 0)]
                joints = np.asarray(pairs[:, ::-1] if swapped else pairs, dtype=np.int32)
            found.append(
                Stitching(
                    name=seam.name, pieces=(surface.name, surface.name), vertices=(first, second), ratio=1.0 / (1.0 + seam.ease),
                    joints=joints,
                    sides=(f"{surface.name}.{seam.lines[0]}", f"{surface.name}.{seam.lines[1]}"),
                )
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"seam {seam.name!r}: {error}") from None
    return found


def _side(surface: Surface, along: set[tuple[int, int]], line: str) -> IntArray:
    """Return the line's vertices in the direction of the border, with the surface to its left."""
    if line not in surface.lines:
        raise InputError(f"unknown line {line!r}; {nearest(line, surface.lines)}")
    ids = np.asarray(surface.lines[line], dtype=np.int32)
    if ids[0] == ids[-1]:
        raise InputError(f"line {line!r} is closed; a side runs from one place of the border to another")
    for run in (ids, ids[::-1]):
        if all(edge in along for edge in pairwise(run.tolist())):
            return np.ascontiguousarray(run)
    a, b = next(edge for edge in pairwise(ids.tolist()) if edge not in along)
    raise InputError(
        f"line {line!r} leaves the border between vertices {a} and {b}; a side is one stretch of border that no cut parts"
    )


def _largest_distance(points: FloatArray, line: FloatArray) -> float:
    """Return the largest distance [m] of some points from a polyline."""
    return float(project_on_segments(points[:, None], line[:-1], line[1:])[1].min(axis=1).max())
