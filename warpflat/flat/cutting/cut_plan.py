"""Cuts as paths on the uncut surface, and the surface that they leave.

All cuts of a piece are made at once on its uncut surface: paths may then meet, cross and branch as they like, and what they have in
common is a matter of the surface alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import arc_lengths
from warpflat.core.short_repr import short_repr
from warpflat.flat.flattening.applied_cut import AppliedCut
from warpflat.flat.surface.cut.crack import Crack
from warpflat.flat.surface.cut.cut_mesh import Cut, cut_along
from warpflat.flat.surface.cut.pieces import apply_cut
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import path_length

__all__ = ["CutPlan", "CutSurface", "carry_layout", "line_part", "make_cuts"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CutPlan:
    """A cut to be made.

    Attributes:
        name: what it is called.
        paths: rows of vertices of the uncut surface along its edges; several are made at once.
        tip_back: how far the tips of its darts are drawn back [m].
    """

    __repr__ = short_repr

    name: str
    paths: tuple[IntArray, ...]
    tip_back: float = 0.0

    @classmethod
    def from_applied(cls, made: AppliedCut) -> CutPlan:
        """Return the plan of a cut that has been made."""
        return cls(name=made.name, paths=made.paths, tip_back=made.tip_back)


def line_part(surface: Surface, name: str, part: tuple[float, float] = (0.0, 1.0)) -> IntArray:
    """Return the vertices of a feature line or of a part of it; its ends are the vertices nearest to the given shares.

    Args:
        surface: with the line.
        name: the line's.
        part: from where to where, in shares of its length.

    Raises:
        InputError: there is no such line (names the nearest), or the part is shorter than an edge.
    """
    if name not in surface.lines:
        raise InputError(f"piece {surface.name!r} has no line {name!r} to cut along; {nearest(name, surface.lines)}")
    line = np.asarray(surface.lines[name], dtype=np.int32)
    arc = arc_lengths(surface.vertices[line])
    station = arc / max(float(arc[-1]), np.finfo(float).tiny)
    first, last = (int(np.argmin(np.abs(station - share))) for share in part)
    if not (min(part) >= 0.0 and max(part) <= 1.0) or first == last:
        raise InputError(
            f"part = [{part[0]:g}, {part[1]:g}] of line {name!r} holds no edge of the mesh; give two shares of its length "
            "from 0 to 1 that lie further apart"
        )
    return line[first : last + 1] if first < last else line[last : first + 1][::-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class CutSurface:
    """A surface with its cuts.

    Attributes:
        surface: with the vertices of the cuts doubled.
        cuts: what was cut.
        cut: the topology that the cuts have left; None if there is no cut.
    """

    surface: Surface
    cuts: tuple[AppliedCut, ...]
    cut: Cut | None


def make_cuts(surface: Surface, plans: Sequence[CutPlan]) -> CutSurface:
    """Make all cuts at once on the uncut surface.

    Raises:
        InputError: a path leaves the mesh, repeats a vertex, runs along the border, or separates nothing.
    """
    if not plans:
        return CutSurface(surface=surface, cuts=(), cut=None)
    topology = cut_along(
        surface.faces, [path for plan in plans for path in plan.paths], vertex_count=len(surface.vertices)
    )
    owner = {edge: number for number, plan in enumerate(plans) for path in plan.paths for edge in _edges(path)}
    seams: list[list[Crack]] = [[] for _ in plans]
    for seam in topology.seams:
        seams[owner[_edges(seam.path)[0]]].append(seam)
    applied = [
        AppliedCut(
            name=plan.name,
            paths=tuple(np.asarray(path, dtype=np.int32) for path in plan.paths),
            seams=tuple(cracks),
            length=path_length(surface, plan.paths),
            tip_back=plan.tip_back,
        )
        for plan, cracks in zip(plans, seams, strict=True)
    ]
    # The relaxation uses what the cut has found out of the new faces.
    cut_surface = replace(apply_cut(surface, topology), of_faces=topology.of_faces)
    return CutSurface(surface=cut_surface, cuts=tuple(applied), cut=topology)


def _edges(path: ArrayLike) -> list[tuple[int, int]]:
    row = np.asarray(path).tolist()
    return [(min(a, b), max(a, b)) for a, b in pairwise(row)]


def carry_layout(positions: FloatArray, faces: IntArray, new_faces: IntArray, count: int) -> FloatArray:
    """Renumber a layout for the same faces with other vertices; copies that are glued lie at their mean.

    Args:
        positions: #P by 2 [m].
        faces, new_faces: #F by 4, the same faces and corners in the old and in the new numbering.
        count: vertices of the new numbering, of which the first keep their numbers.
    """
    carried = np.zeros((count, 2))
    kept = min(count, len(positions))
    carried[:kept] = positions[:kept]
    # Only where a corner has another number than before is there anything to do.
    other = np.zeros(count, dtype=bool)
    other[new_faces[new_faces != faces]] = True
    used = (new_faces >= 0) & other[new_faces]
    pairs = np.unique(np.column_stack([new_faces[used], faces[used]]), axis=0)
    number = np.bincount(pairs[:, 0], minlength=count)
    for axis in range(2):
        total = np.bincount(pairs[:, 0], positions[pairs[:, 1], axis], minlength=count)
        carried[number > 0, axis] = total[number > 0] / number[number > 0]
    return carried
