"""The plan of a form's edges and seams, read off its surfaces before anything is flattened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import InputError, find_unused_name, nearest
from warpflat.garment.construction.edges import Place
from warpflat.pattern import HEMMED_LEVELS, EdgeRules, Seam, SeamSide

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult

__all__ = ["EdgePlan", "FormPlan", "check_fold_grain", "find_fold_lines", "plan_form"]


@dataclass(frozen=True, kw_only=True)
class EdgePlan:
    """A stretch of a form's edge as an edge of the pattern.

    Attributes:
        name: in the pattern.
        source: the form's edge.
        whole: the name of that edge without the darts that interrupt it.
        first, last: the points of that edge from and to which it runs.
        kind: as in `Edge`.
    """

    name: str
    source: str
    whole: str
    first: int
    last: int
    kind: str


@dataclass(frozen=True, kw_only=True)
class FormPlan:
    """The edges, seams and mirror pairs of a form as a pattern.

    Attributes:
        edges: by piece, counter-clockwise.
        seams: between them.
        of_form: for each of the form's seams the seam here, and which of its sides (0 or 1) is the form's first one.
        quantities: by piece, how often it is cut.
    """

    edges: Mapping[str, tuple[EdgePlan, ...]]
    seams: tuple[Seam, ...]
    of_form: tuple[tuple[Seam, int], ...]
    quantities: Mapping[str, int]


@dataclass(frozen=True, kw_only=True)
class _Stretch:
    """A stretch of an edge along one side of a form's seam; a side is one stretch, or several between darts.

    Attributes:
        seam, side: index of the seam, and 0 or 1.
        piece, edge: names.
        first, last: points of the edge.
        against: the seam runs against them.
    """

    seam: int
    side: int
    piece: str
    edge: str
    first: int
    last: int
    against: bool

    @property
    def place(self) -> Place:
        """Names of the piece and the edge."""
        return self.piece, self.edge


def plan_form(form: FormResult, rules: EdgeRules | None = None) -> FormPlan:
    """Work out what every edge of a form becomes in the pattern.

    An edge in a seam is a seam, a half piece's centre the fold. The lowest free edge of a piece is hemmed if it lies
    below the waist or on the arm; other free edges (necks, armholes, waists of skirts) get a seam's allowance, for a
    facing or a band. An edge that is free along a part of its length is split there, and so is one that is sewn to
    parts of edges. An edge that is sewn to several whole edges (a sleeve's cap to a front's and a back's armhole) stays
    whole, and its seams become one. The legs of darts are edges of their own, in no seam; an edge that darts interrupt is
    several edges, in one seam.

    Args:
        form: what `Mannequin.form` gives.
        rules: exceptions.

    Raises:
        InputError: the rules name an edge, a seam or a kind that does not exist.
    """
    rules = rules or EdgeRules()
    sewing = _SewnEdges(form)
    edges: dict[str, tuple[EdgePlan, ...]] = {}
    for name, piece in form.pieces.items():
        planned: list[EdgePlan] = []
        taken: set[str] = set(piece.edges)
        # The lowest of its free edges at a level where garments are hemmed.
        heights = {
            edge: float(np.mean(piece.surface.vertices[ids][:, 1]))
            for edge, ids in piece.edges.items()
            if piece.whole(edge) == edge and edge.split(" ")[0] in HEMMED_LEVELS and not sewing.covers((name, edge))
        }
        lowest = min(heights, key=lambda edge: heights[edge], default=None)
        for edge, ids in piece.edges.items():
            whole = piece.whole(edge)
            parts = sewing.parts((name, edge), len(ids))
            # The edge's own name stays with what is sewn.
            keeper = next((number for number, (_, _, sewn) in enumerate(parts) if sewn), 0)
            for number, (first, last, sewn) in enumerate(parts):
                part = edge if number == keeper else find_unused_name(edge, taken)
                taken.add(part)
                kind = "seam" if sewn else "fold" if edge == piece.fold else "hem" if whole == lowest else "seam"
                kind = "dart" if edge in piece.leg_edges else rules.kind(name, part, kind, whole=whole)
                planned.append(EdgePlan(name=part, source=edge, whole=whole, first=first, last=last, kind=kind))
        edges[name] = tuple(planned)
    rules.check({name: [plan.name for plan in plans] for name, plans in edges.items()})
    half = any(piece.fold for piece in form.pieces.values())
    quantities = {name: 1 if piece.fold or not half else 2 for name, piece in form.pieces.items()}
    names = {(piece, plan.source, plan.first): plan.name for piece, plans in edges.items() for plan in plans}

    def chain(stretches: Sequence[_Stretch], *, turned: bool = False) -> tuple[SeamSide, ...]:
        return tuple(
            SeamSide(piece=s.piece, edge=names[s.piece, s.edge, s.first], reversed=s.against != turned)
            for s in stretches
        )

    # The names of seams that are several of the form's: that of the whole edge, "armhole left".
    parted: dict[Place, set[str]] = {}
    for number, both in enumerate(sewing.sides):
        for around_hub in [side[0].place for side in both if side[0].place in sewing.hubs][:1]:
            parted.setdefault(around_hub, set()).add(form.seams[number].name)
    of_hubs: dict[Place, str] = {}
    for around_hub, joined in parted.items():
        others = {seam.name for seam in form.seams} - joined
        of_hubs[around_hub] = find_unused_name(around_hub[1], others | set(of_hubs.values()))
    # The seams by the hub or the number of the form's seam; a hub's are one seam.
    seams: dict[Place | int, Seam] = {}
    keys: list[tuple[Place | int, int]] = []
    for number, both in enumerate(sewing.sides):
        name = form.seams[number].name
        hub = next((side[0] for side in both if side[0].place in sewing.hubs), None)
        keys.append((number, 0) if hub is None else (hub.place, 1 - hub.side))
        if hub is None:
            sides = chain(both[0]), chain(both[1])
        else:
            around = [chain(sewing.partners(s), turned=s.against) for s in sewing.by_edge[hub.place]]
            sides = (sum(around, ()), (SeamSide(piece=hub.piece, edge=hub.edge),))
            name = of_hubs[hub.place]
        if keys[-1][0] not in seams:
            seams[keys[-1][0]] = Seam(
                name=name,
                sides=sides,
                ease=rules.ease.get(name, 0.0),
                eased=rules.eased.get(name, (0.0, 1.0)),
                notches=tuple(at for at in rules.eased[name] if 0.0 < at < 1.0) if name in rules.eased else None,
            )
    known = [seam.name for seam in seams.values()]
    for name in rules.ease:
        if name not in known:
            raise InputError(f"ease: there is no seam {name!r}; {nearest(name, known)}")
    of_form = tuple((seams[key], side) for key, side in keys)
    return FormPlan(edges=edges, seams=tuple(seams.values()), of_form=of_form, quantities=quantities)


def check_fold_grain(folds: Mapping[str, str], grain_angle: float) -> None:
    """Check that pieces on the fold have their grain along or across it.

    A half is flattened as if its other half were the mirror image, grain included. On cloth that lies on the fold, the
    grain runs straight on once it is unfolded: at any other angle the other half is another piece.

    Args:
        folds: by piece, its edge on the fold, to which the datum is parallel.
        grain_angle: of the warp against the datum [degrees].

    Raises:
        InputError: the grain is oblique to a fold.
    """
    if not folds or grain_angle % 90.0 == 0.0:
        return
    sewn = ", ".join(f'"{edge}" = "seam"' for edge in dict.fromkeys(folds.values()))
    raise InputError(
        f"{', '.join(folds)} on the fold, with the grain at {grain_angle:g} degrees to it: unfolded, the other half is not the mirror "
        f"image that is flattened; cut whole pieces (half = false), lay the grain along or across the fold, or sew there "
        f"(kinds = {{ {sewn} }})"
    )


def find_fold_lines(form: FormResult, plan: FormPlan) -> dict[str, str]:
    """Return by half piece its edge on the fold, without edges to which the rules give another kind."""
    return {
        name: piece.fold
        for name, piece in form.pieces.items()
        if piece.fold and any(part.kind == "fold" for part in plan.edges[name])
    }


class _SewnEdges:
    """The edges of a form that are sewn, stretch by stretch.

    Attributes:
        sides: the stretches along both sides of every seam, in the seam's order.
        by_edge: by piece and edge, the stretches that are sewn, in their order.
        hubs: edges that are sewn to several whole edges of other pieces, one after the other.
    """

    def __init__(self, form: FormResult) -> None:
        self._lengths = {(name, edge): len(ids) for name, p in form.pieces.items() for edge, ids in p.edges.items()}
        self.sides = [(_stretches(form, n, 0), _stretches(form, n, 1)) for n in range(len(form.seams))]
        self.by_edge: dict[Place, list[_Stretch]] = {}
        for stretch in sorted((s for sides in self.sides for side in sides for s in side), key=lambda s: s.first):
            self.by_edge.setdefault(stretch.place, []).append(stretch)
        self.hubs = set[Place]()
        for place, here in self.by_edge.items():
            if len(here) < 2 or not self.covers(place) or any(len(self.sides[s.seam][s.side]) > 1 for s in here):
                continue
            partners = [partner for stretch in here for partner in self.partners(stretch)]
            if all(
                len(self.by_edge[p.place]) == 1 and self.covers(p.place, [p]) and p.place != place for p in partners
            ):
                self.hubs.add(place)

    def partners(self, stretch: _Stretch) -> tuple[_Stretch, ...]:
        """Return the other side of a stretch's seam, in the direction of the stretch's edge."""
        other = self.sides[stretch.seam][1 - stretch.side]
        return other[::-1] if stretch.against else other

    def covers(self, place: Place, stretches: Sequence[_Stretch] | None = None) -> bool:
        """Return whether an edge is sewn all along; by all its stretches, or by some in their order."""
        here = self.by_edge.get(place, []) if stretches is None else stretches
        ends = [0, *(stretch.last for stretch in here)]
        joined = all(stretch.first == end for stretch, end in zip(here, ends, strict=False))
        return joined and ends[-1] == self._lengths[place] - 1

    def parts(self, place: Place, count: int) -> list[tuple[int, int, bool]]:
        """Split an edge of `count` points: first and last point of each part, and whether it is sewn."""
        here = self.by_edge.get(place, [])
        whole = not here or place in self.hubs or (len(here) == 1 and self.covers(place))
        ends = [] if whole else [end for stretch in here for end in (stretch.first, stretch.last)]
        cuts = sorted({0, count - 1, *ends})
        return [(a, b, any(stretch.first <= a and b <= stretch.last for stretch in here)) for a, b in pairwise(cuts)]


def _stretches(form: FormResult, number: int, side: int) -> tuple[_Stretch, ...]:
    """Return one side of a form's seam as stretches of edges; runs that follow each other along an edge are one."""
    seam, found = form.seams[number], list[_Stretch]()
    piece = seam.pieces[side]
    for run in seam.runs:
        edge, (first, last), against = run.edges[side], run.spans[side], run.against and side == 1
        stretch = _Stretch(seam=number, side=side, piece=piece, edge=edge, first=first, last=last, against=against)
        if found and found[-1].edge == edge and (found[-1].first == last if against else found[-1].last == first):
            before = found.pop()
            stretch = replace(stretch, first=min(first, before.first), last=max(last, before.last))
        found.append(stretch)
    return tuple(found)
