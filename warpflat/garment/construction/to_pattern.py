"""From a flattened garment to its pattern: the edges of its pieces with their kinds, its darts and seams, its labels.

Of a form the edges follow from the form alone (:func:`plan_form`), so that a wrong name in a scene is found before anything is
relaxed; the flat layouts give the shapes. Of a mesh the border is split at its corners in the plane, and named by the lines along it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    IntArray,
    find_unused_name,
    off_line,
    polyline_length,
    quote_value,
    unit,
)
from warpflat.flat import (
    are_curved,
    border_loops,
    fish_eye_measure,
    grain_axes,
    join_labels,
    pull_back,
    seam_kind,
    separate,
)
from warpflat.garment.construction.closed_cuts import CLOSED, are_closed, close_cuts, seams_of_cuts
from warpflat.garment.construction.darts import open_length, pleat_depths, pull_back_eye
from warpflat.garment.construction.ease import measure_ease
from warpflat.garment.construction.edges import SHORT, lengths_of, with_pieces
from warpflat.garment.construction.equal_pieces import draw_equal_pieces_once
from warpflat.garment.construction.facings import STAND, Stand
from warpflat.garment.construction.finishing import finish_edges, hem_rises
from warpflat.garment.construction.fly import with_flies
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.form_plan import EdgePlan, check_fold_grain, find_fold_lines, plan_form
from warpflat.garment.construction.line_drawing import describe_worn
from warpflat.garment.construction.mark_openings import mark_openings
from warpflat.garment.construction.meet import SAME_PLACE
from warpflat.garment.construction.mirror_pieces import draw_pairs_once
from warpflat.garment.construction.openings import one_sided, place_opening
from warpflat.garment.construction.pockets import add_pockets
from warpflat.garment.mannequin.seam_names import name_seams
from warpflat.pattern import (
    CLOTH_WIDTH,
    DEFAULT_ALLOWANCE,
    FOLD_STRAIGHT,
    SEAM_TOLERANCE,
    Dart,
    Edge,
    EdgeRules,
    Hole,
    MeshFeatures,
    Pattern,
    Piece,
    Seam,
    SeamSide,
    curve_through,
    default_grain,
    joint_words,
    line_labels,
    optional_step,
    piece_from_mesh,
    runs_without,
)

if TYPE_CHECKING:
    from warpflat.flat import Crack, Flattening, Surface
    from warpflat.garment.construction.details import SeamTable
    from warpflat.garment.construction.garment import Garment
    from warpflat.garment.construction.openings import OpeningPart
    from warpflat.garment.construction.sewn import Stitching
    from warpflat.garment.mannequin.pieces import FormPiece

__all__ = ["LACKING", "check_edge_names", "grain_of", "pattern_of_garment", "pattern_of_surface"]


#: A datum that strays from the grain by no more than this [m] carries the grain line.
ON_DATUM = 1e-3
# Decimals [m] of the layouts to which curves are fitted: of two that differ by rounding errors the same pattern is drawn.
_DECIMALS = 6
#: Least distance [m] of the grain line from darts and holes, and the steps [m] in which it is moved aside.
GRAIN_CLEAR, GRAIN_STEP = 0.008, 0.010
#: A side of a seam is a row of at most so many edges, parted by corners in the plane.
_MOST_EDGES = 8
#: A piece hangs this far [m] in front of its surface, if its border spans the plane by this share at least.
BESIDE, ALIGNED = 0.05, 1e-3
#: How a note on a seam of a mesh begins that its pattern lacks.
LACKING = "not sewn in the pattern:"
# How a note on a pattern begins that does not show how it is worn.
_NO_DRAWING = "the guide has no line drawing of the garment"
# What lines along a border are called that nobody has named, with the numbers of their stretches.
_UNNAMED = re.compile(r"(to .+|edge|seam)(_\d+)?( \d+)*")


@dataclass(frozen=True, kw_only=True)
class _Drawn:
    """What a source has drawn: all pieces, each whole, and the seams between them.

    Attributes:
        pattern: pieces and seams.
        notes: what was chosen on the way, one sentence each.
        is_whole: whether these are all pieces of a garment, so that one is drawn of those that are alike, and how it is worn.
        unlike: pieces that are going to be cut unlike their mirror images.
        placed: by size and opening, the seams that it runs along.
        alike: how the names of pieces begin that may be drawn once where they are equal.
    """

    pattern: Pattern
    notes: tuple[str, ...]
    is_whole: bool = True
    unlike: Collection[str] = ()
    placed: Mapping[str, Sequence[Sequence[OpeningPart]]] = field(default_factory=dict)
    alike: str = ""


def pattern_of_garment(
    garments: Mapping[str, Garment],
    *,
    name: str,
    rules: EdgeRules | None = None,
    sample_size: str | None = None,
    twice: bool = True,
    cloth_width: float = CLOTH_WIDTH,
) -> tuple[Pattern, tuple[str, ...]]:
    """Make the pattern of a garment; of one on a form in one or more sizes. For a mesh see :func:`pattern_of_surface`.

    Of two pieces that are each other's mirror images in every size the first is drawn, to be cut twice. A half piece
    whose centre did not come out straight cannot lie on the fold: it is cut twice, in every size, with a seam in the
    centre. Notes say so.

    Args:
        garments: flattened, by size; "" where there is none.
        name: of the pattern.
        rules: exceptions for edges.
        sample_size: see :class:`Pattern`.
        twice: whether of two mirror images of a mesh one is drawn, to be cut twice.
        cloth_width: usable width of the cloth [m], to which strips and flounces are parted.

    Returns:
        The pattern, and what was chosen on the way, one sentence each.

    Raises:
        InputError: the rules name an edge that does not exist, the grain is oblique to a fold, a piece's outline
            crosses itself, or the sizes differ in their edges.
    """
    rules, sample = rules or EdgeRules(), next(iter(garments.values()))
    forms = {size: garment for size, garment in garments.items() if isinstance(garment, FormGarment)}
    if forms:
        drawn = _drawn_on_forms(forms, name, rules, sample_size)
    else:
        drawn = _drawn_of_meshes(sample, name, rules, twice=twice)
    pattern, notes, garments = drawn.pattern, drawn.notes, forms or {"": sample}
    if drawn.is_whole:
        pattern, pairs = draw_pairs_once(pattern, garments, drawn.unlike)
        notes += pairs
    pattern = mark_openings(pattern, sample.openings, drawn.placed)
    gaps = [
        row[0].seam
        for row, opening in zip(drawn.placed.get(pattern.sample, ()), sample.openings, strict=True)
        if opening.opens_the_top
    ]
    stands = [
        Stand(piece=piece.name, edge=edge.name, width=opening.facing_width, grown_on=opening.facing != "separate")
        for opening in sample.openings
        if opening.kind == "buttons"
        for piece in pattern.pieces[pattern.sample]
        for edge in piece.edges
        if edge.name == f"{opening.seam} {STAND}"
    ]
    rises: Mapping[tuple[str, str], Any] = {}
    with optional_step("the pattern has no finishing"):
        rises = hem_rises(pattern, sample.finishing)
        girths = {size: garment.body_girths for size, garment in garments.items()}
        pattern = finish_edges(
            pattern, sample.finishing, gaps=gaps, stands=stands, girths=girths, cloth_width=cloth_width
        )
    with optional_step("the pattern has no pockets"):
        pattern = with_flies(add_pockets(pattern, sample.pockets))
    if drawn.is_whole and not rises:
        # Equal pieces stay equal, unless a slanted hem cuts them.
        pattern, equal = draw_equal_pieces_once(pattern, called=drawn.alike)
        notes += equal
    # Seams along lines without a name of the user's are called by the pieces that they join.
    seams, taken = list[Seam](), {seam.name for seam in pattern.seams if not _UNNAMED.fullmatch(seam.name)}
    for seam in pattern.seams:
        if _UNNAMED.fullmatch(seam.name):
            seam = replace(seam, name=find_unused_name(joint_words(seam), taken))
            taken.add(seam.name)
        seams.append(seam)
    pattern = replace(pattern, seams=tuple(seams))
    if sample.as_cut is not None:
        # What was cut is as long as the curves through the vertices of its edges, not as their chords.
        curved = []
        for piece in pattern:
            lines = [edge.points if edge.kind == "fold" else curve_through(edge.points) for edge in piece.edges]
            edges = [
                edge if len(points) == len(edge.points) else replace(edge, points=points, vertices=None)
                for edge, points in zip(piece.edges, lines, strict=True)
            ]
            curved.append(replace(piece, edges=edges))
        pattern = with_pieces(pattern, curved)
    if drawn.is_whole:
        with optional_step(_NO_DRAWING, is_needed=False):
            pattern = replace(pattern, worn=describe_worn(garments, pattern, rises))
    return pattern, notes


def _drawn_of_meshes(sample: Garment, name: str, rules: EdgeRules, *, twice: bool) -> _Drawn:
    """Draw the pieces of meshes; those that are sewn along a part of an edge alone are parted there, if that sews them."""
    worn = {own for pair in sample.stitching if pair.pieces[0] != pair.pieces[1] for own in pair.pieces}
    ends: dict[str, set[int]] = {}
    for _ in range(2):
        pattern, notes = pattern_of_surface(
            list(sample.parts.values()), name=name, rules=rules, seams=sample.border_seams, ends=ends, worn=worn
        )
        lacking = _lacking_seams(sample, pattern)
        if not lacking or ends:
            break
        # A seam that ends within an edge of one side alone: that edge is parted there.
        for pair, run in lacking:
            for each, along in zip(pair.pieces, pair.vertices, strict=True):
                ends.setdefault(each, set()).update(along[[run[0], run[-1] + 1]].tolist())
    for pair, run in lacking:
        chain, flat = pair.vertices[0][run[0] : run[-1] + 2], sample.pieces[pair.pieces[0]]
        place = ", ".join(f"{100 * x:.0f}" for x in flat.network.surface.vertices[chain[len(chain) // 2]] + 0.0)
        notes += (
            f"{LACKING} {1e3 * polyline_length(flat.positions[chain]):.0f} mm of the seam of "
            f"{' and '.join(dict.fromkeys(pair.pieces))} about ({place}) cm: no edges of them fit each other there",
        )
    # Where a side was cut longer than the other, as on a band that is stretched, it is eased in.
    as_laid = {frozenset(pair.pieces) for pair in sample.stitching if pair.eased}
    stretched = {frozenset(pair.pieces) for pair in sample.stitching if pair.eased and np.any(pair.ratio != 1.0)}
    seams = list[Seam]()
    for seam in pattern.seams:
        joined = frozenset(side.piece for side in seam.stretches)
        if joined in stretched:
            # Its longer side is the last one.
            first, second = sorted(seam.sides, key=lambda row: sum(lengths_of(pattern, row)))
            one, other = sum(lengths_of(pattern, first)), sum(lengths_of(pattern, second))
            if other - one > SEAM_TOLERANCE:
                seam = replace(seam, sides=(first, second), ease=other / one - 1.0)
        seams.append(replace(seam, as_laid=joined in as_laid))
    is_whole = twice and len(sample.pieces) > 1 and sample.parts.keys() == sample.pieces.keys()
    return _Drawn(pattern=replace(pattern, seams=seams), notes=notes, is_whole=is_whole)


def _drawn_on_forms(
    garments: Mapping[str, FormGarment], name: str, rules: EdgeRules, sample_size: str | None
) -> _Drawn:
    """Draw the pieces of forms, in every size, with what of openings and hems is cut into one side of the body alone."""
    sample = next(iter(garments.values()))
    if sample.wished is not None:
        ease, eased = measure_ease(sample.form, sample.wished, sample.positions)
        rules = replace(rules, ease={**ease, **rules.ease, **{seam: ease[seam] for seam in eased}}, eased=eased)
    plans = {size: plan_form(garment.form, rules) for size, garment in garments.items()}
    plan = next(iter(plans.values()))
    # Relaxation keeps a piece upright, but not in its place: the lower ends of its datum lie where the sample size has them.
    still = garments.get(sample_size or "", sample)
    laid, there = dict[str, FormGarment](), still.evened()
    for size, garment in garments.items():
        moved = {}
        for piece, even in garment.evened().items():
            flat = garment.pieces[piece]
            offset = there[piece][still.pieces[piece].datum[0]] - even[flat.datum[0]]
            moved[piece] = replace(flat, positions=np.round(even + offset, _DECIMALS))
        laid[size] = replace(garment, pieces=moved)
    # Half pieces whose fold strays from straight in some size, and by how much [m] at most.
    bent: dict[str, float] = {}
    for garment in laid.values():
        for piece, flat in garment.pieces.items():
            edge = garment.form.pieces[piece].fold
            if edge is not None:
                points = flat.positions[garment.form.pieces[piece].edges[edge]]
                stray = float(off_line(points, points[[0, -1]]).max())
                if stray > max(FOLD_STRAIGHT, bent.get(piece, 0.0)):
                    bent[piece] = stray
    folds = {piece: edge for piece, edge in find_fold_lines(sample.form, plan).items() if piece not in bent}
    opened = {piece: each.fold for piece, each in sample.form.pieces.items() if each.fold and piece not in folds}
    for flat in (garment.pieces[piece] for garment in laid.values() for piece in folds):
        check_fold_grain(folds, flat.grain_angle)
    pieces: dict[str, tuple[Piece, ...]] = {}
    for size, garment in laid.items():
        pleats = pleat_depths(garment.form)
        pieces[size] = tuple(
            _form_piece(
                flat,
                garment.form.pieces[piece],
                plans[size].edges[piece],
                rules=rules,
                size=size,
                quantity=2 if piece in opened else plan.quantities[piece],
                open_fold=piece in opened,
                pleats={dart: depth for (own, dart), depth in pleats.items() if own == piece},
            )
            for piece, flat in garment.pieces.items()
        )
    # A piece that is cut twice instead of on the fold has a seam in its centre.
    seams = plan.seams
    for title, (piece, edge) in zip(
        name_seams(list(opened.values()), [(piece, piece) for piece in opened]), opened.items(), strict=True
    ):
        side = SeamSide(piece=piece, edge=edge)
        title = find_unused_name(title, {seam.name for seam in seams})
        seams = (*seams, Seam(name=title, sides=((side,), (replace(side, mirrored=True),))))
    placed = {
        size: [place_opening(garment.form, opening, garment.positions) for opening in garment.openings]
        for size, garment in laid.items()
    }
    # One pattern cannot serve for both sides where an opening is cut into just one of them, or a hem slants to one side.
    cut = one_sided(sample.openings)
    rows = zip(sample.openings, placed[next(iter(garments))], strict=True)
    parted = {part.seam for opening, parts in rows for part in parts if opening in cut}
    unlike = {side.piece for seam in seams if seam.name in parted for side in seam.stretches}
    slanted = {wish.edge for wish in sample.finishing if wish.is_one_sided}
    unlike |= {piece.name for piece in pieces[next(iter(pieces))] for edge in piece.edges if edge.name in slanted}
    notes = tuple(
        f"{piece}: {opened[piece]} bends by {stray * 1000:.1f} mm and cannot lie on the fold: cut twice, with a seam there"
        for piece, stray in bent.items()
    )
    pattern = Pattern(name=name, pieces=pieces, seams=seams, sample_size=sample_size)
    # Of the pieces of a form no others are equal: godets are.
    return _Drawn(pattern=pattern, notes=notes, unlike=unlike, placed=placed, alike="godet")


def _form_piece(
    flat: Flattening,
    piece: FormPiece,
    plan: Sequence[EdgePlan],
    *,
    rules: EdgeRules,
    size: str,
    quantity: int,
    open_fold: bool,
    pleats: Mapping[str, float],
) -> Piece:
    """Return one piece of a garment with its edges, internal lines and grain."""
    name = piece.surface.name
    edges = []
    for part in plan:
        vertices = np.asarray(piece.edges[part.source])[part.first : part.last + 1]
        kind = "seam" if open_fold and part.kind == "fold" else part.kind
        # A leg's allowance is for a dart that is cut away, not folded.
        of_kind = "seam" if kind == "dart" else kind
        allowance = rules.allowance(name, part.name, of_kind, whole=part.whole)
        points = flat.positions[vertices]
        edges.append(Edge(name=part.name, points=points, kind=kind, allowance=allowance, vertices=vertices))
    # Where the legs of a dart overlap by less than `CLOSED` short of its tip, the tip moves back to where they meet.
    by_name = {edge.name: edge for edge in edges}
    for dart, names in piece.darts.items():
        first, second = (by_name[each] for each in names)
        count, overlap = open_length(first.points, second.points[::-1])
        if count == 0:
            raise InputError(
                f"piece {name!r}: dart {dart!r} overlaps at its mouth: the cloth wants no dart there; leave it out, or give "
                "it a width, mouth_mm = 10"
            )
        if overlap > CLOSED:
            raise InputError(
                f"piece {name!r}: the legs of dart {dart!r} overlap by {1e3 * overlap:.2g} mm: let it open wider, mouth_mm = 15, "
                "or make it shorter"
            )
        if count == len(first.points):
            continue
        kept = slice(0, count)
        tip = 0.5 * (first.points[count] + second.points[::-1][count])
        for leg, turn in ((first, 1), (second, -1)):
            points = np.vstack([leg.points[::turn][kept], tip])[::turn]
            ids = (
                None
                if leg.vertices is None
                else np.append(leg.vertices[::turn][kept], leg.vertices[::turn][-1])[::turn]
            )
            by_name[leg.name] = replace(leg, points=points, vertices=ids)
    edges = list(by_name.values())
    legs = {edge.name: edge.points for edge in edges if edge.kind == "dart"}
    darts = [
        Dart(
            name=dart,
            left=left,
            right=right,
            cut=are_curved(legs[left], legs[right]),
            pleat=pleats.get(dart),
        )
        for dart, (left, right) in piece.darts.items()
    ]
    holes = [
        Hole(name=dart, points=np.vstack([flat.positions[left], flat.positions[right[-2:0:-1]]])[::-1], kind="dart")
        for dart, (left, right) in piece.fisheyes.items()
    ]
    border = [*piece.edges.values(), *(leg for legs in piece.fisheyes.values() for leg in legs)]
    along = _inner_lines({piece.datum: piece.surface.lines[piece.datum]}, border, flat.positions)
    drawn = Piece(
        name=name,
        size=size,
        fabric=flat.fabric.name,
        quantity=quantity,
        edges=edges,
        darts=darts,
        holes=holes,
        internal_lines=_inner_lines(piece.surface.lines, border, flat.positions),
        grain=grain_of(
            np.concatenate([edge.points[:-1] for edge in edges]),
            flat,
            max(along.values(), key=len, default=None),
        ),
    )
    return replace(drawn, placement=_placement(drawn, flat))


def _placement(piece: Piece, flat: Flattening) -> FloatArray | None:
    """Return where a flat piece hangs: as its border lies in space, as rigidly as that goes (Kabsch 1976), and in front of its surface.

    None without a border that is known in space, or one along which the piece lies every way as well.
    """
    edges = [edge for edge in piece.edges if edge.vertices is not None]
    if not edges:
        return None
    plane = np.concatenate([edge.points for edge in edges])
    space = flat.surface.vertices[flat.vertex_origin[np.concatenate([edge.vertices for edge in edges])]]
    middle = space.mean(axis=0)
    left, sizes, right = np.linalg.svd((space - middle).T @ (plane - plane.mean(axis=0)), full_matrices=False)
    if sizes[1] < ALIGNED * sizes[0]:
        return None
    turn = left @ right
    outward = np.cross(turn[:, 0], turn[:, 1])
    away = float(((flat.surface.vertices - middle) @ outward).max()) + BESIDE
    return np.column_stack([turn, middle + away * outward - turn @ plane.mean(axis=0)])


def _inner_lines(lines: Mapping[str, Any], border: Sequence[IntArray], flat: FloatArray) -> dict[str, FloatArray]:
    """Return the stretches of feature lines inside a piece, #P by 2 [m]; a second stretch of a line is "NAME 2".

    Args:
        lines: vertex indices by name.
        border: vertex indices along every edge, both ends included.
        flat: #V by 2 [m].
    """
    edges = {(min(a, b), max(a, b)) for ids in border for a, b in pairwise(np.asarray(ids).tolist())}
    found: dict[str, FloatArray] = {}
    for name, line in lines.items():
        for stretch in runs_without(np.asarray(line), edges):
            found[find_unused_name(name, found)] = flat[stretch]
    return found


def grain_of(outline: FloatArray, flat: Flattening, datum: FloatArray | None = None) -> FloatArray:
    """Return the grain line along the warp (2 by 2 [m]), on the datum where that is straight.

    Elsewhere it runs through the widest place.

    Args:
        outline: #P by 2 [m].
        flat: the piece.
        datum: #P by 2 [m]; None if it does not lie inside the piece.
    """
    x, y = grain_axes(flat.grain_angle)[0]
    turn = np.array([[y, -x], [x, y]])
    if datum is not None:
        along = datum @ turn.T
        if np.ptp(along[:, 0]) <= ON_DATUM:
            low, high = float(along[:, 1].min()), float(along[:, 1].max())
            ends = np.array([low + (high - low) / 6, high - (high - low) / 6])
            return np.column_stack([np.full(2, along[:, 0].mean()), ends]) @ turn
    return default_grain(outline @ turn.T) @ turn


def pattern_of_surface(
    results: Sequence[Flattening],
    *,
    name: str,
    rules: EdgeRules | None = None,
    seams: Sequence[SeamTable] = (),
    ends: Mapping[str, Collection[int]] | None = None,
    worn: Collection[str] = (),
) -> tuple[Pattern, tuple[str, ...]]:
    """Make the pattern of one flattened surface, or of the pieces into which cuts have parted it.

    A cut with one tip inside becomes a dart of its name, one with two tips a fish-eye dart; their tips are moved back
    as the cut asks for. A cut that parts the surface is a seam between the two pieces.

    Args:
        results: pieces of different names.
        name: of the pattern.
        rules: kinds and allowances of edges and holes; an edge along a feature line has the line's name, others are
            called "edge_1" and so on, counter-clockwise.
        seams: of the border, by the lines that are sewn to each other.
        ends: by piece the vertices at which its border is parted into edges, beside its corners and the ends of lines.
        worn: pieces that are sewn to others in space, where a crack that gapes is a vent and no dart.

    Returns:
        The pattern, and what was chosen on the way, one sentence each: names of edges that no piece has are left out.

    Raises:
        InputError: the rules have an unknown kind, a border crosses itself, a crack overlaps, its tip is moved back too
            far, or a named seam's side is no edge.
    """
    rules = rules or EdgeRules()
    ends = ends or {}
    results = [replace(result, positions=np.round(result.positions, _DECIMALS)) for result in results]
    drawn = dict[str, Piece]()
    for result in results:
        with optional_step(f"{result.surface.name} was left out of the pattern") if len(results) > 1 else nullcontext():
            own = result.surface.name
            drawn[own] = _mesh_piece(result, ends.get(own, ()), is_worn=own in worn)
    if not drawn:
        raise InputError("none of the pieces can be drawn")
    results, pieces = [result for result in results if result.surface.name in drawn], list(drawn.values())
    named = []
    for seam in seams:
        with optional_step(f"seam {seam.name!r} was left out of the pattern"):
            first, second = (_edges_along(line, results, pieces) for line in seam.lines)
            back = tuple(replace(side, reversed=True) for side in reversed(second))  # the two run against each other
            named.append(Seam(name=seam.name, sides=(first, back), ease=seam.ease))
    names = {p.name: [*(edge.name for edge in p.edges), *(hole.name for hole in p.holes)] for p in pieces}
    rules, notes = rules.known(names)
    notes += tuple(
        f"cut {quote_value(title)} opens by less than {1e3 * CLOSED:g} mm: the pattern is whole there, with a line"
        for result in results
        for title in _closed_cuts(result)
    )
    rules.check(names)
    ruled = []
    for piece in pieces:
        edges, holes = [], []
        for edge in piece.edges:
            # The allowance of a dart's leg is for one that is cut away, not folded.
            kind = "seam" if edge.kind == "dart" else rules.kind(piece.name, edge.name, edge.kind)
            width = rules.allowance(piece.name, edge.name, kind)
            edges.append(replace(edge, kind="dart" if edge.kind == "dart" else kind, allowance=width))
        for hole in piece.holes:
            if hole.kind != "dart":
                kind = rules.kind(piece.name, hole.name, "seam")
                if kind not in ("seam", "hem", "cut"):
                    raise InputError(
                        f"kinds.{hole.name}: a hole cannot be of kind {kind!r}; give it 'seam', 'hem' or 'cut'"
                    )
                width = rules.allowance(piece.name, hole.name, kind)
                hole = replace(hole, allowance=DEFAULT_ALLOWANCE[kind] if width is None else width)
            holes.append(hole)
        ruled.append(replace(piece, edges=edges, holes=holes))
    return Pattern(name=name, pieces={"": ruled}, seams=_mesh_seams(results, ruled, rules, named)), notes


def _mesh_piece(result: Flattening, ends: Collection[int] = (), *, is_worn: bool = False) -> Piece:
    """Return one piece with its cuts as darts, and its grain."""
    import shapely

    darts: dict[str, tuple[int, int, int]] = {}
    fisheyes: dict[str, Crack] = {}
    tip_back = {title: cut.tip_back for title, cut, _ in seams_of_cuts(result)}
    closed = _closed_cuts(result)
    faces, lines = result.faces, dict(result.network.surface.lines)
    if closed:
        faces, lines = close_cuts(faces, lines, closed, count=len(result.positions))
    loops = border_loops(faces)
    for title, _, seam in seams_of_cuts(result):
        kind = seam_kind(seam)
        if title in closed:
            continue
        if kind == "fish-eye":
            fisheyes[title] = seam
        elif kind == "dart" and (places := _dart_places(loops, seam)) is not None:
            darts[title] = places
    piece = piece_from_mesh(
        faces,
        result.positions,
        name=result.surface.name,
        features=MeshFeatures(
            lines=lines,
            darts=darts,
            fisheyes={title: np.union1d(seam.left, seam.right) for title, seam in fisheyes.items()},
            ends=ends,
            worn=result.surface.vertices[result.vertex_origin] if is_worn else None,
        ),
        fabric=result.fabric.name,
    )
    # The tip of a dart lies short of the end of its cut, both tips of a fish-eye dart short of both ends.
    for title in [title for title in (*darts, *fisheyes) if tip_back[title] > 0]:
        try:
            if title in darts:
                left, right = piece.edge(f"{title}.left"), piece.edge(f"{title}.right")
                legs = pull_back(left.points, right.points[::-1], tip_back[title])
                moved = {left.name: legs[0], right.name: legs[1][::-1]}
                edges = [replace(edge, points=moved.get(edge.name, edge.points)) for edge in piece.edges]
                piece = replace(piece, edges=edges)
            else:
                at, sides = result.positions, (fisheyes[title].left, fisheyes[title].right)
                station = fish_eye_measure(at, *sides).station
                one, other = pull_back_eye(at[sides[0]], at[sides[1]], station, tip_back[title])
                ring = np.concatenate([other[:-1], one[:0:-1]])
                holes = [replace(hole, points=ring) if hole.name == title else hole for hole in piece.holes]
                piece = replace(piece, holes=holes)
        except InputError as reason:
            raise InputError(f"piece {piece.name!r}: dart {title!r}: {reason}") from None
    drawn = [
        replace(dart, cut=are_curved(piece.edge(dart.left).points, piece.edge(dart.right).points))
        for dart in piece.darts
    ]
    on_border = np.isin(result.datum, np.concatenate(loops)).mean() > 0.5
    datum = None if on_border else result.positions[result.datum]
    # The grain line moves aside as far as it takes to keep off holes and fish-eye darts.
    line = grain_of(piece.outline, result, datum)
    along = unit(line[1] - line[0])
    across = np.array([along[1], -along[0]])
    free = shapely.Polygon(piece.outline, [hole.points for hole in piece.holes]).buffer(-GRAIN_CLEAR)
    lines_aside = (line + side * step * GRAIN_STEP * across for step in range(31) for side in (1, -1))
    grain = next((each for each in lines_aside if free.contains(shapely.LineString(each))), line)
    return replace(piece, darts=drawn, grain=grain, placement=_placement(piece, result))


def _closed_cuts(result: Flattening) -> dict[str, Crack]:
    return {title: seam for title, _, seam in seams_of_cuts(result) if are_closed(result.positions, seam)}


def _dart_places(loops: Sequence[IntArray], cut: Crack) -> tuple[int, int, int] | None:
    """Return left mouth, tip and right mouth of a dart, counter-clockwise; None where it does not open at a border."""
    at_end = cut.left[-1] == cut.right[-1]
    tip = int(cut.left[-1] if at_end else cut.left[0])
    mouths = [int(side[0] if at_end else side[-1]) for side in (cut.left, cut.right)]
    for loop in loops:
        where = {vertex: place for place, vertex in enumerate(loop.tolist())}
        if all(vertex in where for vertex in (tip, *mouths)):
            first, second = sorted(mouths, key=lambda v: (where[tip] - where[v]) % len(loop))
            return first, tip, second
    return None


def _edges_along(line: str, results: Sequence[Flattening], pieces: Sequence[Piece]) -> tuple[SeamSide, ...]:
    """Return the edges along a line, in order, as the border runs."""
    for result, piece in zip(results, pieces, strict=True):
        ids = result.network.surface.lines.get(line)
        if ids is None:
            continue
        along = [
            e for e in piece.edges if e.vertices is not None and e.kind != "dart" and np.isin(e.vertices, ids).all()
        ]
        if sum(len(edge.points) - 1 for edge in along) != len(ids) - 1:
            continue
        ends = {int(edge.vertices[-1]) for edge in along if edge.vertices is not None}
        start = next((k for k, e in enumerate(along) if e.vertices is not None and int(e.vertices[0]) not in ends), 0)
        return tuple(SeamSide(piece=piece.name, edge=edge.name) for edge in along[start:] + along[:start])
    raise InputError(f"line {line!r} is no whole stretch of a piece's border; a cut or another line parts it")


def _mesh_seams(
    results: Sequence[Flattening], pieces: Sequence[Piece], rules: EdgeRules, named: Sequence[Seam]
) -> tuple[Seam, ...]:
    """Return the seams: those that are named, and pairs of rows of edges that are one curve in space.

    A corner in the plane parts the edge of one side alone: its other side is then sewn to a row of edges.
    """
    from scipy.spatial import cKDTree

    seams: list[Seam] = [*named]
    done = {side.place for seam in named for side in seam.stretches}
    rows: list[tuple[tuple[SeamSide, ...], FloatArray]] = []
    for result, piece in zip(results, pieces, strict=True):
        vertices, count = result.network.surface.vertices, len(piece.edges)
        for start in range(count):
            ids: list[int] = []
            for length in range(1, min(count, _MOST_EDGES) + 1):
                edge = piece.edges[(start + length - 1) % count]
                if edge.kind not in ("seam", "cut") or edge.vertices is None or (piece.name, edge.name) in done:
                    break
                if ids and (ids[-1] != edge.vertices[0] or ids[0] == ids[-1]):
                    break
                ids = [*ids[:-1], *edge.vertices.tolist()]
                sides = [piece.edges[(start + k) % count].name for k in range(length)]
                rows.append((tuple(SeamSide(piece=piece.name, edge=name) for name in sides), vertices[ids]))
    if not rows:
        return tuple(seams)
    # Only rows whose ends lie at the same two places can be one curve.
    ends = np.array([curve[[0, -1]] for _, curve in rows]).reshape(-1, 3)
    place = join_labels(len(ends), *cKDTree(ends).query_pairs(SAME_PLACE, output_type="ndarray").T)
    groups: dict[tuple[int, ...], list[tuple[tuple[SeamSide, ...], FloatArray]]] = {}
    for row, here in zip(rows, np.sort(place.reshape(-1, 2), axis=1).tolist(), strict=True):
        groups.setdefault(tuple(here), []).append(row)

    def are_one(curve: FloatArray, other: FloatArray) -> bool:
        return len(curve) == len(other) and bool(np.linalg.norm(curve - other, axis=1).max() < SAME_PLACE)

    # Those of fewest edges first, in the order of the pieces.
    order = {row: number for number, (row, _) in enumerate(rows)}
    pairs = [pair for group in groups.values() for pair in combinations(group, 2)]
    for (first, curve), (second, other) in sorted(
        pairs, key=lambda pair: (len(pair[0][0]) + len(pair[1][0]), order[pair[0][0]])
    ):
        taken = [side.place for side in (*first, *second)]
        if len(set(taken)) < len(taken) or not done.isdisjoint(taken):
            continue
        against = not are_one(curve, other)
        if not are_one(curve, other[::-1] if against else other):
            continue
        done.update(taken)
        name = first[0].edge.removesuffix(".left").removesuffix(".right")
        name = find_unused_name(name, {seam.name for seam in seams})
        beside = tuple(replace(side, reversed=against) for side in (second[::-1] if against else second))
        seams.append(Seam(name=name, sides=(first, beside), ease=rules.ease.get(name, 0.0)))
    return tuple(seams)


def _lacking_seams(garment: Garment, pattern: Pattern) -> list[tuple[Stitching, IntArray]]:
    """Return each stretch of a seam of meshes, longer than 1 mm, that is in no seam of the pattern, with the places of its edges.

    What the user has given another kind than that of a seam, and cuts that are darts or have closed, are none.
    """
    (pieces,) = pattern.pieces.values()
    of_part = {
        part.surface.name: name
        for name, piece in garment.pieces.items()
        for part in (separate(piece) if piece.cuts else (piece,))
    }
    seam_of = {side.place: number for number, seam in enumerate(pattern.seams) for side in seam.stretches}
    # Each mesh edge of an outline, by its piece and its ends in the layout: the number of its seam, -1 for none; None if it is meant to
    # be in none.
    sewn: dict[tuple[str, frozenset[bytes]], int | None] = {}
    for drawn in pieces:
        layout = garment.parts[drawn.name].positions
        for edge in drawn.edges:
            number = seam_of.get((drawn.name, edge.name), -1 if edge.kind in ("seam", "cut") else None)
            for a, b in pairwise([] if edge.vertices is None else edge.vertices.tolist()):
                sewn[of_part[drawn.name], frozenset((layout[a].tobytes(), layout[b].tobytes()))] = number
    found = []
    for pair in garment.stitching:
        if pair.joints is not None:
            # Named by lines that are whole edges.
            continue
        # A cut that has closed, or lies inside a piece, is no edge; nor is the border of a hole, to which nothing can be sewn.
        first = garment.pieces[pair.pieces[0]]
        missing = None if pair.name in [title for title, *_ in seams_of_cuts(first)] else -1
        numbers, layouts = list[list[int | None]](), [garment.pieces[name].positions for name in pair.pieces]
        for name, layout, row in zip(pair.pieces, layouts, pair.vertices, strict=True):
            ends = [layout[vertex].tobytes() for vertex in row.tolist()]
            numbers.append([sewn.get((name, frozenset(both)), missing) for both in pairwise(ends)])
        lost = [None not in (one, other) and (one != other or one == -1) for one, other in zip(*numbers, strict=True)]
        length = np.linalg.norm(np.diff(layouts[0][pair.vertices[0]], axis=0), axis=1)
        for run in np.split(np.arange(len(lost)), np.flatnonzero(np.diff(lost)) + 1):
            if lost[run[0]] and length[run].sum() > SHORT:
                found.append((pair, run.astype(np.int32)))
    return found


def check_edge_names(surfaces: Iterable[Surface], rules: EdgeRules, *, cuts: Iterable[str] = ()) -> None:
    """Check that every name in the rules can be an edge's, before anything is flattened.

    Lines along the border name the edges, holes are numbered. Where corners split them shows only in the plane.
    Therefore "bottom_2" passes if there is a bottom, and "edge_7" if there is a stretch of border without a line.

    Args:
        surfaces: with their lines, cut as they are going to be.
        rules: as of :func:`pattern_of_surface`.
        cuts: names of the cuts, for the legs of their darts.

    Raises:
        InputError: a name that no piece can have (gives the nearest).
    """
    legs = "|".join(map(re.escape, ["dart", *cuts]))
    edges: dict[str, list[str]] = {}
    for surface in surfaces:
        loops = border_loops(surface.faces)
        lines = {label for loop in loops for label in line_labels(loop, surface.lines)}
        names = {line or "edge" for line in lines}
        later = re.compile(rf"({'|'.join(map(re.escape, sorted(names)))})_\d+|({legs})(_\d+)?\.(left|right)")
        asked = {name.removeprefix(f"{surface.name}.") for name in (*rules.kinds, *rules.allowances)}
        known = {line or "edge_1" for line in lines} | {name for name in asked if later.fullmatch(name)}
        known |= {f"hole_{number}" for number in range(1, len(loops))}
        edges.setdefault(surface.name, []).extend(sorted(known))
    rules.check(edges)
