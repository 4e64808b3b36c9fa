"""From a flattened garment to a pattern: the edges of its pieces with their kinds, its seams, its labels.

Which edge is a seam, a hem or the fold follows from the form alone, so that a wrong name in a scene is found before
anything is relaxed (:func:`plan_form`); the flat layouts give the shapes (:func:`pattern_of_garment`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.arrays import FloatArray, IntArray
from warpflat.errors import InputError, nearest
from warpflat.pattern.label import default_grain
from warpflat.pattern.pieces import DEFAULT_ALLOWANCE, EDGE_KINDS, FOLD_STRAIGHT, Edge, Garment, Piece, Seam, SeamSide
from warpflat.pattern.twins import find_twins, sew_twins

if TYPE_CHECKING:
    from warpflat.flattening import Flattening
    from warpflat.garment import Garment as FlatGarment
    from warpflat.mannequin import FormResult
    from warpflat.mannequin.pieces import FormPiece

__all__ = [
    "EdgePlan",
    "EdgeRules",
    "FormPlan",
    "check_fold_grain",
    "folds_of",
    "grain_of",
    "inner_lines",
    "pattern_of_garment",
    "plan_form",
    "unused",
]

Sides = tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]]

#: Levels at which a free lower edge is hemmed. One at the waist or above is the line of a block, to be joined to a
#: skirt, a band or a facing.
HEMMED = ("abdomen", "hip", "thigh", "knee", "calf", "ankle", "biceps", "elbow", "wrist")
#: A datum that strays from the grain by no more than this [m] carries the grain line.
ON_DATUM = 1e-3


@dataclass(frozen=True, kw_only=True)
class EdgeRules:
    """What a maker wants of the edges.

    Attributes:
        seam, hem: allowance [m] of all edges of these kinds.
        kinds: kind by edge, as "piece.edge", or "edge" for every piece that has one of that name.
        allowances: allowance [m] by edge, named likewise.
        ease: by seam: how much longer its second side is, as a share of the first.
    """

    seam: float = DEFAULT_ALLOWANCE["seam"]
    hem: float = DEFAULT_ALLOWANCE["hem"]
    kinds: Mapping[str, str] = field(default_factory=dict)
    allowances: Mapping[str, float] = field(default_factory=dict)
    ease: Mapping[str, float] = field(default_factory=dict)

    def check(self, edges: Mapping[str, Sequence[str]]) -> None:
        """See that every name is an edge, and every kind one.

        Args:
            edges: names of the edges by piece.

        Raises:
            InputError: a name that no piece has (gives the nearest), or an unknown kind.
        """
        for said in self._unknown(edges).values():
            raise InputError(said)
        for name, kind in self.kinds.items():
            if kind not in EDGE_KINDS:
                raise InputError(f"kinds.{name}: unknown kind {kind!r}; {nearest(kind, EDGE_KINDS)}")

    def known(self, edges: Mapping[str, Sequence[str]]) -> tuple[EdgeRules, tuple[str, ...]]:
        """The rules without names that no piece has, and a sentence about each of these.

        For names that show in the plane only; `edges` as for :meth:`check`.
        """
        unknown = self._unknown(edges)
        kinds = {name: kind for name, kind in self.kinds.items() if ("kinds", name) not in unknown}
        allowances = {name: width for name, width in self.allowances.items() if ("allowances_mm", name) not in unknown}
        notes = tuple(f"left out of the pattern: {said}" for said in unknown.values())
        return replace(self, kinds=kinds, allowances=allowances), notes

    def _unknown(self, edges: Mapping[str, Sequence[str]]) -> dict[tuple[str, str], str]:
        """Names that no piece has, with the table that has each, and what to say of it."""
        known = {f"{piece}.{edge}" for piece, names in edges.items() for edge in names}
        known |= {edge for names in edges.values() for edge in names}
        return {
            (key, name): f"{key}: no piece has an edge {name!r}; {nearest(name, known)}"
            for key, mapping in (("kinds", self.kinds), ("allowances_mm", self.allowances))
            for name in mapping
            if name not in known
        }

    def kind(self, piece: str, edge: str, default: str) -> str:
        """The kind of an edge."""
        return self.kinds.get(f"{piece}.{edge}", self.kinds.get(edge, default))

    def allowance(self, piece: str, edge: str, kind: str) -> float | None:
        """The allowance [m] of an edge; None leaves it to its kind."""
        if kind == "fold":
            return None
        of_kind = {"seam": self.seam, "hem": self.hem}.get(kind)
        return self.allowances.get(f"{piece}.{edge}", self.allowances.get(edge, of_kind))


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


def pattern_of_garment(
    garments: Mapping[str, FlatGarment], *, name: str, rules: EdgeRules | None = None, sample_size: str | None = None
) -> tuple[Garment, tuple[str, ...]]:
    """The pattern of a garment in one or more sizes.

    Of two pieces that are each other's mirror images in every size the first is drawn, to be cut twice. A half piece whose
    centre did not come out straight cannot lie on the fold: it is cut twice, in every size, with a seam in the centre. Notes
    say so.

    Args:
        garments: flattened, by size; "" where there is none.
        name: of the pattern.
        rules: exceptions for edges.
        sample_size: see :class:`Garment`.

    Returns:
        The pattern, and what was chosen on the way, one sentence each.

    Raises:
        InputError: the rules name an edge that does not exist, the grain is oblique to a fold, a piece's outline crosses itself,
            or the sizes differ in their edges.
    """
    rules = rules or EdgeRules()
    plans = {size: plan_form(garment.form, rules) for size, garment in garments.items()}
    bent = _bent_folds(garments)
    form, plan = next(iter(garments.values())).form, next(iter(plans.values()))
    folds = {name: edge for name, edge in folds_of(form, plan).items() if name not in bent}
    opened = {name: piece.fold for name, piece in form.pieces.items() if piece.fold and name not in folds}
    for flat in (garment.pieces[name] for garment in garments.values() for name in folds):
        check_fold_grain(folds, flat.grain_angle)
    pieces = {
        size: tuple(
            _piece(
                flat, garment.form.pieces[piece], plans[size].edges[piece], rules=rules, size=size,
                quantity=2 if piece in opened else plan.quantities[piece], open_fold=piece in opened,
            )
            for piece, flat in garment.pieces.items()
        )
        for size, garment in garments.items()
    }  # fmt: skip
    seams = plan.seams
    for piece, edge in opened.items():
        side = (SeamSide(piece=piece, edge=edge),)
        seams = (*seams, Seam(name=unused(edge, {seam.name for seam in seams}), sides=(side, side)))
    twins = find_twins(garments, pieces, seams)
    seams = sew_twins(seams, twins)
    drawn = {twin.of for twin in twins}
    pieces = {
        size: tuple(
            replace(piece, quantity=2 * piece.quantity) if piece.name in drawn else piece
            for piece in row
            if piece.name not in {twin.name for twin in twins}
        )
        for size, row in pieces.items()
    }
    notes = tuple(f"{twin.of}: cut twice, once mirrored, it serves for {twin.name} too" for twin in twins)
    notes += tuple(
        f"{piece}: {opened[piece]} bends by {stray * 1000:.1f} mm and cannot lie on the fold: cut twice, with a seam there"
        for piece, stray in bent.items()
    )
    return Garment(name=name, pieces=pieces, seams=seams, sample_size=sample_size), notes


def grain_of(outline: FloatArray, flat: Flattening, datum: FloatArray | None = None) -> FloatArray:
    """2 by 2 [m], along the warp: on the datum (#P by 2 [m]) where that is straight, else through the widest place."""
    from warpflat.fabric import grain_axes

    x, y = grain_axes(flat.grain_angle)[0]
    turn = np.array([[y, -x], [x, y]])
    if datum is not None:
        along = datum @ turn.T
        if np.ptp(along[:, 0]) <= ON_DATUM:
            low, high = float(along[:, 1].min()), float(along[:, 1].max())
            ends = np.array([low + (high - low) / 6, high - (high - low) / 6])
            return np.column_stack([np.full(2, along[:, 0].mean()), ends]) @ turn
    return default_grain(outline @ turn.T) @ turn


def inner_lines(lines: Mapping[str, Any], border: Sequence[IntArray], flat: FloatArray) -> dict[str, FloatArray]:
    """The stretches of feature lines inside a piece, #P by 2 [m], without what runs along its border.

    Args:
        lines: vertex indices by name.
        border: vertex indices along every edge, both ends included.
        flat: #V by 2 [m].
    """
    edges = {(min(a, b), max(a, b)) for ids in border for a, b in pairwise(np.asarray(ids).tolist())}
    found: dict[str, FloatArray] = {}
    for name, line in lines.items():
        runs: list[list[int]] = [[]]
        for a, b in pairwise(np.asarray(line).tolist()):
            if (min(a, b), max(a, b)) in edges:
                runs.append([])
            else:
                runs[-1] += [b] if runs[-1] else [a, b]
        for run in (run for run in runs if run):
            found[unused(name, found)] = flat[run]
    return found


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


def _bent_folds(garments: Mapping[str, FlatGarment]) -> dict[str, float]:
    """Half pieces whose fold strays from straight in some size, and by how much [m] at most."""
    bent: dict[str, float] = {}
    for garment in garments.values():
        for name, flat in garment.pieces.items():
            piece = garment.form.pieces[name]
            if piece.fold is None:
                continue
            points = flat.positions[piece.edges[piece.fold]]
            span, away = points[-1] - points[0], points - points[0]
            length = max(float(np.linalg.norm(span)), 1e-12)
            stray = float(np.abs(away[:, 0] * span[1] - away[:, 1] * span[0]).max()) / length
            if stray > max(FOLD_STRAIGHT, bent.get(name, 0.0)):
                bent[name] = stray
    return bent


def _piece(
    flat: Flattening,
    piece: FormPiece,
    plan: Sequence[EdgePlan],
    *,
    rules: EdgeRules,
    size: str,
    quantity: int,
    open_fold: bool,
) -> Piece:
    name = piece.surface.name
    edges = []
    for part in plan:
        vertices = np.asarray(piece.edges[part.source])[part.first : part.last + 1]
        kind = "seam" if open_fold and part.kind == "fold" else part.kind
        allowance = rules.allowance(name, part.name, kind)
        points = flat.positions[vertices]
        edges.append(Edge(name=part.name, points=points, kind=kind, allowance=allowance, vertices=vertices))
    border = list(piece.edges.values())
    along = inner_lines({piece.datum: piece.surface.lines[piece.datum]}, border, flat.positions)
    return Piece(
        name=name,
        size=size,
        fabric=flat.fabric.name,
        quantity=quantity,
        edges=edges,
        internal_lines=inner_lines(piece.surface.lines, border, flat.positions),
        grain=grain_of(
            np.concatenate([edge.points[:-1] for edge in edges]),
            flat,
            max(along.values(), key=len, default=None),
        ),
    )


def unused(name: str, taken: Mapping[str, Any] | set[str]) -> str:
    """ "name 2" or the first number after that is free."""
    number = 2
    while f"{name} {number}" in taken:
        number += 1
    return f"{name} {number}" if name in taken else name
