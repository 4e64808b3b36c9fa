"""Sewing one flattened surface, cut or not: its darts, cuts, named seams and constraints."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.core.text import find_unused_name
from warpflat.flattening.result import Flattening
from warpflat.garment.constraints import Constraint
from warpflat.garment.fullness import FullEdge, give_fullness
from warpflat.garment.seam_length import SeamLengths
from warpflat.garment.sew_pieces import meeting_borders
from warpflat.garment.sewing import sew
from warpflat.garment.sewn import SeamPair, Sewn
from warpflat.solver.options import RelaxOptions
from warpflat.surface.border_seams import NamedSeam, SurfaceSeam, surface_seams
from warpflat.surface.mesh import Surface

__all__ = ["SewnSurface", "sew_surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SewnSurface:
    """A surface relaxed under the seams of its cuts and under constraints.

    Attributes:
        result: the piece, whole, even where cuts have parted it.
        sewn: outcome of the relaxation.
        seams: measured; those of the cuts, then the named ones.
    """

    result: Flattening
    sewn: Sewn
    seams: tuple[SeamLengths, ...]

    def metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` besides the pieces."""
        return {
            "seams": [seam.as_dict() for seam in self.seams],
            "constraints": [result.as_dict() for result in self.sewn.constraints],
            "sewing": self.sewn.as_dict(),
        }


def sew_surface(
    result: Flattening,
    constraints: Sequence[Constraint] = (),
    *,
    seams: Sequence[NamedSeam] = (),
    options: RelaxOptions | None = None,
) -> SewnSurface | None:
    """Relax a piece again so that its seams and darts match and its constraints hold; None if it has none of these.

    Args:
        result: flattened, perhaps cut.
        constraints: on its lines.
        seams: of its border, besides those of its cuts.
        options: of the relaxation.

    Raises:
        InputError: a constraint or a seam names a line that the piece does not have, or asks what the line cannot be.
    """
    found = surface_seams(result.network.surface, seams)
    result = _with_fullness(result, found, options)
    name = result.surface.name
    pairs = [
        SeamPair(
            name=made.name if len(made.seams) == 1 else f"{made.name}_{number}",
            pieces=(name, name),
            vertices=(seam.left, seam.right),
        )
        for made in result.cuts
        for number, seam in enumerate(made.seams, start=1)
    ]
    titles = [(f"{pair.name}.left", f"{pair.name}.right") for pair in pairs] + [seam.named.sides for seam in found]
    pairs += [
        SeamPair(
            name=seam.named.name,
            pieces=(name, name),
            vertices=seam.vertices,
            ratio=1.0 / (1.0 + seam.named.ease),
            joints=seam.joints,
        )
        for seam in found
    ]
    sewn_edges = {(min(edge), max(edge)) for pair in pairs for row in pair.vertices for edge in pairwise(row.tolist())}
    # What was cut open before, here or in the file, is sewn like any cut.
    for pair in meeting_borders({name: result.network.surface}, without=sewn_edges):
        opening = _opening(result.network.surface, pair)
        title = find_unused_name(opening or pair.name, {pair.name for pair in pairs})
        pairs.append(replace(pair, name=title))
        titles.append((f"{opening or title}.left", f"{opening or title}.right"))
    if not pairs and not constraints:
        return None
    sewn = sew({name: result}, pairs, constraints=constraints, options=options)
    after = sewn.pieces[name]
    measured = tuple(
        SeamLengths(
            name=pair.name,
            sides=(f"{name}.{title[0]}", f"{name}.{title[1]}"),
            length_3d=polyline_length(after.network.surface.vertices[pair.vertices[0]]),
            lengths=(
                polyline_length(after.positions[pair.vertices[0]]),
                polyline_length(after.positions[pair.vertices[1]]),
            ),
            ease=1.0 / float(pair.ratio) - 1.0,
            cost=result.cost,
        )
        for pair, title, result in zip(pairs, titles, sewn.results, strict=False)
    )
    return SewnSurface(result=after, sewn=sewn, seams=measured)


def _opening(surface: Surface, pair: SeamPair) -> str | None:
    """Return the name of the line along which a stretch of border was cut open."""
    first = {frozenset(side[:2].tolist()) for side in pair.vertices}
    for name, line in surface.lines.items():
        side = re.fullmatch(r"(.+)\.(left|right)(\.\d+)?'*", name)
        if side is not None and not first.isdisjoint(map(frozenset, pairwise(line.tolist()))):
            return side[1]
    return None


def _with_fullness(result: Flattening, seams: Sequence[SurfaceSeam], options: RelaxOptions | None) -> Flattening:
    """Return the piece with more cloth along the sides that are meant to be longer."""
    full = [
        FullEdge(vertices=seam.vertices[seam.named.longer], factor=seam.named.factor, gathered=seam.named.gathered)
        for seam in seams
        if seam.named.factor > 1.0
    ]
    if not full:
        return result
    if result.cuts:
        name = next(seam.named.name for seam in seams if seam.named.factor > 1.0)
        raise InputError(
            f"seam {name!r}: fullness and gathers need a piece that is not cut; leave out the cuts or the fullness"
        )
    plain = [
        ids
        for seam in seams
        for side, ids in enumerate(seam.vertices)
        if seam.named.factor == 1.0 or side != seam.named.longer
    ]
    return give_fullness(result, full, plain, options=options)
