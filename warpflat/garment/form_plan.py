"""The plan of a form's edges and seams, read off its surfaces before anything is flattened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.pattern.pieces import Seam, SeamSide

if TYPE_CHECKING:
    from warpflat.mannequin.forms import FormResult
from warpflat.garment.edge_rules import HEMMED, EdgeRules, unused

__all__ = ["EdgePlan", "FormPlan", "Sides", "check_fold_grain", "folds_of", "plan_form"]

Sides = tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]]


@dataclass(frozen=True, kw_only=True)
class EdgePlan:
    """A stretch of a form's edge: `name` in the pattern, `source` the form's edge, and from which of its points to which."""

    name: str
    source: str
    first: int
    last: int
    kind: str


@dataclass(frozen=True, kw_only=True)
class FormPlan:
    """Edges by piece, counter-clockwise, the seams between them, and how often each piece is cut."""

    edges: Mapping[str, tuple[EdgePlan, ...]]
    seams: tuple[Seam, ...]
    quantities: Mapping[str, int]


@dataclass(frozen=True, kw_only=True)
class _Run:
    """One side of a form's seam: points `first` to `last` of an edge, and whether the seam runs against them."""

    seam: int
    side: int
    piece: str
    edge: str
    first: int
    last: int
    against: bool

    @property
    def place(self) -> tuple[str, str]:
        return self.piece, self.edge


def plan_form(form: FormResult, rules: EdgeRules | None = None) -> FormPlan:
    """What every edge of a form becomes.

    An edge in a seam is a seam, a half piece's centre the fold. Of the free edges the lowest of a piece is hemmed
    if it lies below the waist or on the arm; the others (necks, armholes, waists of skirts) get a seam's allowance, for a
    facing or a band. An edge that is free along a part of its length is split there, and so is one that is sewn to
    parts of edges; one that is sewn to several whole edges (a sleeve's cap to a front's and a back's armhole) stays
    whole, and they are one seam.

    Args:
        form: what `Mannequin.form` gives.
        rules: exceptions.

    Raises:
        InputError: the rules name an edge or a kind that does not exist.
    """
    rules = rules or EdgeRules()
    runs = _runs(form)
    of_edge: dict[tuple[str, str], list[_Run]] = {}
    for run in sorted((r for pair in runs for r in pair), key=lambda r: r.first):
        of_edge.setdefault(run.place, []).append(run)
    hubs = {place for place, here in of_edge.items() if _is_hub(form, place, here, runs, of_edge)}
    edges: dict[str, tuple[EdgePlan, ...]] = {}
    title: dict[tuple[str, str, int], str] = {}
    for name, piece in form.pieces.items():
        plans: list[EdgePlan] = []
        taken: set[str] = set(piece.edges)
        lowest = _lowest(form, name, of_edge)
        for edge, ids in piece.edges.items():
            here = of_edge.get((name, edge), [])
            whole = not here or (name, edge) in hubs or (len(here) == 1 and _covers(here, len(ids)))
            cuts = (
                [0, len(ids) - 1] if whole else sorted({0, len(ids) - 1, *(i for r in here for i in (r.first, r.last))})
            )
            parts = [(a, b, any(r.first <= a and b <= r.last for r in here)) for a, b in pairwise(cuts)]
            # The edge's own name stays with what is sewn.
            keeper = next((number for number, (_, _, sewn) in enumerate(parts) if sewn), 0)
            for number, (first, last, sewn) in enumerate(parts):
                part = edge if number == keeper else unused(edge, taken)
                taken.add(part)
                title[name, edge, first] = part
                kind = "seam" if sewn else "fold" if edge == piece.fold else "hem" if edge == lowest else "seam"
                plans.append(
                    EdgePlan(name=part, source=edge, first=first, last=last, kind=rules.kind(name, part, kind))
                )
        edges[name] = tuple(plans)
    rules.check({name: [plan.name for plan in plans] for name, plans in edges.items()})
    seams = _seams(form, runs, hubs, of_edge, title, rules)
    half = any(piece.fold for piece in form.pieces.values())
    quantities = {name: 1 if piece.fold or not half else 2 for name, piece in form.pieces.items()}
    return FormPlan(edges=edges, seams=seams, quantities=quantities)


def check_fold_grain(folds: Mapping[str, str], grain_angle: float) -> None:
    """See that pieces on the fold have their grain along or across it.

    A half is flattened as if the other one were its mirror image, grain and all. Cloth on the fold, unfolded, has its grain running
    on straight: at any other angle that is another piece.

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


def folds_of(form: FormResult, plan: FormPlan) -> dict[str, str]:
    """By half piece, its edge on the fold; without those for which the rules ask another kind of that edge."""
    return {
        name: piece.fold
        for name, piece in form.pieces.items()
        if piece.fold and any(part.kind == "fold" for part in plan.edges[name])
    }


def _runs(form: FormResult) -> list[tuple[_Run, _Run]]:
    """Both sides of every seam of the form."""
    runs = []
    for number, seam in enumerate(form.seams):
        sides = []
        for side in (0, 1):
            piece, edge, vertices = seam.pieces[side], seam.edges[side], np.asarray(seam.vertices[side])
            ids = np.asarray(form.pieces[piece].edges[edge])
            against = not _found(ids, vertices)
            first = _found(ids, vertices[::-1] if against else vertices)[0]
            sides.append(
                _Run(
                    seam=number, side=side, piece=piece, edge=edge, first=first, last=first + len(vertices) - 1,
                    against=against,
                )
            )  # fmt: skip
        runs.append((sides[0], sides[1]))
    return runs


def _found(ids: IntArray, vertices: IntArray) -> list[int]:
    """Where in an edge a row of vertices lies."""
    count = len(vertices)
    return [i for i in range(len(ids) - count + 1) if np.array_equal(ids[i : i + count], vertices)]


def _covers(here: Sequence[_Run], count: int) -> bool:
    """Whether runs, in order, leave nothing free of an edge with so many points."""
    ends = [0, *(run.last for run in here)]
    return all(run.first == end for run, end in zip(here, ends, strict=False)) and ends[-1] == count - 1


def _is_hub(
    form: FormResult,
    place: tuple[str, str],
    here: Sequence[_Run],
    runs: Sequence[tuple[_Run, _Run]],
    of_edge: Mapping[tuple[str, str], Sequence[_Run]],
) -> bool:
    """Whether an edge is sewn to several whole edges of other pieces, one after the other."""
    piece, edge = place
    if len(here) < 2 or not _covers(here, len(form.pieces[piece].edges[edge])):
        return False
    partners = [runs[run.seam][1 - run.side] for run in here]
    return all(
        len(of_edge[p.place]) == 1 and _covers([p], len(form.pieces[p.piece].edges[p.edge])) and p.place != place
        for p in partners
    )


def _seams(
    form: FormResult,
    runs: Sequence[tuple[_Run, _Run]],
    hubs: set[tuple[str, str]],
    of_edge: Mapping[tuple[str, str], Sequence[_Run]],
    title: Mapping[tuple[str, str, int], str],
    rules: EdgeRules,
) -> tuple[Seam, ...]:
    seams: list[Seam] = []
    done: set[tuple[str, str]] = set()
    for first, second in runs:
        name = form.seams[first.seam].name
        hub = next((run.place for run in (first, second) if run.place in hubs), None)
        if hub is None:
            parts = [
                SeamSide(piece=r.piece, edge=title[r.piece, r.edge, r.first], reversed=r.against)
                for r in (first, second)
            ]
            sides: Sides = ((parts[0],), (parts[1],))
        elif hub in done:
            continue
        else:
            done.add(hub)
            chain = tuple(
                SeamSide(piece=p.piece, edge=p.edge, reversed=p.against != run.against)
                for run in of_edge[hub]
                for p in [runs[run.seam][1 - run.side]]
            )
            sides = (chain, (SeamSide(piece=hub[0], edge=hub[1]),))
        seams.append(Seam(name=name, sides=sides, ease=rules.ease.get(name, 0.0)))
    for name in rules.ease:
        if name not in {seam.name for seam in seams}:
            raise InputError(f"ease: there is no seam {name!r}; {nearest(name, [seam.name for seam in seams])}")
    return tuple(seams)


def _lowest(form: FormResult, name: str, sewn: Mapping[tuple[str, str], Any]) -> str | None:
    """The lowest of a piece's free edges at a level where garments are hemmed."""
    piece = form.pieces[name]
    heights = {
        edge: float(np.mean(piece.surface.vertices[ids][:, 1]))
        for edge, ids in piece.edges.items()
        if edge.split(" ")[0] in HEMMED and not _covers(sewn.get((name, edge), []), len(ids))
    }
    return min(heights, key=lambda edge: heights[edge]) if heights else None
