"""Finishing of a pattern's own free edges: facings, bands, waistbands, cuffs, ruffles, collars, hoods, casings and slanted hems."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, InputError, find_unused_name, nearest, other_side, without_side
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.collars import Collar, with_collar, with_hood
from warpflat.garment.construction.facings import Stand, centre_notch, is_beside, with_facings, with_stand_facings
from warpflat.garment.construction.flounces import with_flounce
from warpflat.garment.construction.free_edges import Break, FreeChain, chain_length, free_chains
from warpflat.garment.construction.plackets import with_placket, with_slits
from warpflat.garment.construction.shaped_band import shortened, slant_rises, with_shaped_waistband
from warpflat.garment.construction.strips import CLOTH_WIDTH, Strip, panel_count, strip_edges, swept
from warpflat.pattern import Elastic, Pattern, Piece, Seam, SeamSide

__all__ = ["FINISHES", "Finishing", "finish_edges", "hem_rises", "with_plackets"]

#: By kind the width of a finishing piece [m]; of what is folded that of the finished piece, which is cut twice as wide.
FINISHES = {
    "facing": 0.06,
    "band": 0.02,
    "waistband": 0.035,
    "binding": 0.035,
    "cuff": 0.06,
    "ruffle": 0.08,
    "flounce": 0.12,
    "casing": 0.03,
    "collar": 0.032,
    "hood": 0.0,
    "hem": 0.0,
}
#: Strips by kind: whether they are folded, the direction of their grain, their role.
_STRIPS = {
    "band": (True, (0.0, 1.0), "strip"),
    "waistband": (True, (1.0, 0.0), "waistband"),
    "cuff": (True, (1.0, 0.0), "cuff"),
    "binding": (False, (0.7071, 0.7071), "strip"),
    "ruffle": (False, (0.0, 1.0), "strip"),
    # A turtleneck, which is doubled and turned down.
    "collar": (True, (0.0, 1.0), "strip"),
}
# Allowance of the hem of a ruffle, and of the edge of a casing that is turned in [m].
_NARROW = 0.010


@dataclass(frozen=True, kw_only=True)
class Finishing:
    """A finishing of free edges.

    Attributes:
        kind: one of `FINISHES`.
        edge: name of the edges, without their side: "neck", "armhole", "waist".
        width: [m].
        share: length of a strip over that of its edge: a band is stretched, what is sewn to a waistband or cuff is gathered,
            and a ruffle is gathered itself.
        overlap: by how much a waistband or cuff runs past one end [m].
        shaped: whether a waistband is cut from the upper strip of the pieces, as curved as they are, not straight.
        shorten: by how much the pieces end before the edge, since the strip takes the place [m]; by line, where lines meet the edge.
        elastic: length of the elastic in a folded strip or casing, as a share of the body's girth there; 0 where there is none.
        placket: length of a slit that opens the edge [m]; below a collar in the centre front.
        pleat: visible width of a pleat of a ruffle that is laid in pleats, not gathered [m]; 0 for none.
        turns: how much of a circle a flounce is; more than one overlaps itself and is cut in pieces.
        collar: what a collar or hood is like.
    """

    kind: str
    edge: str
    width: float
    share: float = 1.0
    overlap: float = 0.0
    shaped: bool = False
    shorten: float | Mapping[str, float] = 0.0
    elastic: float = 0.0
    placket: float = 0.0
    pleat: float = 0.0
    turns: float = 0.5
    collar: Collar | None = None

    @property
    def is_one_sided(self) -> bool:
        """Whether it makes one side of the body unlike the other."""
        by_line = self.shorten if isinstance(self.shorten, Mapping) else {}
        return any(
            by_line.get(other_side(line)) != wide for line, wide in by_line.items() if without_side(line) != line
        )

    @property
    def name(self) -> str:
        """Return what its pieces are called."""
        return self.kind if self.kind in ("waistband", "cuff", "collar") else f"{self.edge}_{self.kind}"


def finish_edges(
    pattern: Pattern,
    finishing: Sequence[Finishing],
    *,
    gaps: Collection[str] = (),
    stands: Sequence[Stand] = (),
    girths: Mapping[str, Mapping[str, float]] | None = None,
    cloth_width: float = CLOTH_WIDTH,
) -> Pattern:
    """Return a pattern with the pieces that finish its edges, and the seams that join them.

    Args:
        pattern: with all its openings.
        finishing: what is wanted.
        gaps: names of seams that an opening leaves open at their upper end; a band ends there.
        stands: button stands; what no facing of an edge beside them takes along gets one of its own.
        girths: of the body by size and level [m], and of the "head", for elastics and hoods.
        cloth_width: usable width of the cloth [m]; strips and flounces that are wider are cut as equal panels.

    Raises:
        InputError: no free edge has the name, or a piece cannot be drawn there.
    """
    # First what takes cloth away, then the facings of stands that no facing of an edge beside them takes along: other pieces may part
    # the edges beside a stand.
    faced = set[Stand]()
    for number, wish in enumerate(finishing):
        try:
            pattern, places = _opened_up(pattern, wish.edge, sewn=wish.kind != "hem")
            if wish.shorten:
                pattern = shortened(pattern, places, wish.shorten)
            if wish.kind == "facing":
                faced |= {stand for stand in stands for place in places if is_beside(pattern, stand, place)}
        except InputError as error:
            raise InputError(f"finishing[{number}]: {error}") from None
    pattern = with_stand_facings(pattern, [stand for stand in stands if stand not in faced])
    for number, wish in enumerate(finishing):
        if wish.kind == "hem":
            continue
        try:
            pattern, places = _opened_up(pattern, wish.edge)
            if wish.elastic:
                # Around one limb where the edge has a side.
                levels = [places[0][1], wish.edge, f"{wish.edge} left"]
                lengths = {size: wish.elastic * _girth_at(size, levels, girths or {}) for size in pattern.pieces}
                pattern = replace(
                    pattern,
                    elastics=(
                        *pattern.elastics,
                        Elastic(edge=wish.edge, width=wish.width, lengths=lengths, count=_count(places)),
                    ),
                )
            if wish.kind == "facing":
                pattern = with_facings(pattern, places, wish.width, gaps=gaps, stands=stands)
            elif wish.collar is not None and wish.kind == "hood":
                heads = {size: _girth_at(size, ["head"], girths or {}) for size in pattern.pieces}
                pattern = with_hood(pattern, places, wish.collar, heads, gaps=gaps)
            elif wish.collar is not None and wish.collar.style != "turtleneck":
                breaks: list[Break] = []
                if wish.placket:
                    pattern, breaks = with_placket(pattern, places, wish.placket, wish.edge)
                    pattern, places = _opened_up(pattern, wish.edge)
                pattern = with_collar(pattern, places, wish.collar, gaps=gaps, breaks=breaks)
            elif wish.kind == "flounce":
                for chain, _ in free_chains(pattern, places, gaps):
                    pattern = with_flounce(pattern, chain, wish.width, wish.turns, wish.edge, cloth_width)
            elif wish.kind == "casing":
                pattern = _with_casing(pattern, places, wish)
            elif wish.shaped:
                pattern = with_shaped_waistband(pattern, places, wish.width, gaps=gaps)
            else:
                breaks = []
                if wish.placket:
                    pattern, breaks = with_slits(pattern, places, wish.placket, "sleeve")
                    pattern, places = _opened_up(pattern, wish.edge)
                for chain, count in free_chains(pattern, places, gaps, breaks):
                    pattern = _with_strip(pattern, wish, chain, count, cloth_width)
        except InputError as error:
            raise InputError(f"finishing[{number}]: {error}") from None
    return pattern


def hem_rises(pattern: Pattern, finishing: Sequence[Finishing]) -> dict[tuple[str, str], tuple[FloatArray, FloatArray]]:
    """Return how wide a strip slanted hems lose in the sample size, as :func:`slant_rises` gives it."""
    found = dict[tuple[str, str], tuple[FloatArray, FloatArray]]()
    for wish in finishing:
        if isinstance(wish.shorten, Mapping):
            places = _opened_up(pattern, wish.edge, sewn=False)[1]
            found |= slant_rises(pattern, places, wish.shorten, pattern.sample)
    return found


def with_plackets(opened: Mapping[str, float], finishing: Sequence[Finishing]) -> dict[str, float]:
    """Return what openings add to rings [m], with both edges of the plackets below collars."""
    found = dict(opened)
    for wish in finishing:
        if wish.kind == "collar" and wish.placket:
            found[wish.edge] = found.get(wish.edge, 0.0) + 2.0 * wish.placket
    return found


def _opened_up(pattern: Pattern, called: str, *, sewn: bool = True) -> tuple[Pattern, list[tuple[str, str]]]:
    """Return the free edges of a name, and the pattern with those that were hems as edges to be sewn, unless they stay hems.

    Raises:
        InputError: there is none; gives the nearest.
    """
    taken = {(side.piece, side.edge) for seam in pattern.seams for row in seam.sides for side in row}
    free = [
        (piece.name, edge)
        for piece in pattern.pieces[pattern.sample]
        for edge in piece.edges
        if (piece.name, edge.name) not in taken
        and (edge.kind == "seam" or (edge.kind == "hem" and piece.role == "shell"))
    ]
    names = {edge.name: without_side(edge.name).rstrip(" 0123456789") for _, edge in free}
    places = [(piece, edge.name) for piece, edge in free if names[edge.name] == called]
    if not places:
        raise InputError(f"no free edge {called!r}; {nearest(called, set(names.values()))}")
    hems = {(piece, edge.name) for piece, edge in free if edge.kind == "hem"} & set(places)
    if hems and sewn:
        pieces = {}
        for size, row in pattern.pieces.items():
            made = []
            for piece in row:
                # As wide as the allowance of the piece's other seams.
                width = next((edge.width for edge in piece.edges if edge.kind == "seam"), None)
                edges = [
                    replace(edge, kind="seam", allowance=width) if (piece.name, edge.name) in hems else edge
                    for edge in piece.edges
                ]
                made.append(replace(piece, edges=edges))
            pieces[size] = made
        pattern = replace(pattern, pieces=pieces)
    return pattern, places


def _count(places: Sequence[tuple[str, str]]) -> int:
    """Return how many rings the garment has of some edges: one on each side of the body, or one."""
    return 2 if any(without_side(edge) != edge for _, edge in places) else 1


def _girth_at(size: str, levels: Sequence[str], girths: Mapping[str, Mapping[str, float]]) -> float:
    """Return the body's girth at the first of some levels that it has [m].

    Raises:
        InputError: it has none of them.
    """
    own = girths.get(size, {})
    for name in levels:
        if name in own:
            return own[name]
    raise InputError(f"the body has no girth at {levels[0]!r}; {nearest(levels[0], own)}")


def _with_casing(pattern: Pattern, places: Sequence[tuple[str, str]], wish: Finishing) -> Pattern:
    """Return a pattern whose edges are turned in as a casing: an allowance of its width, with the edge turned in once more."""
    pieces = {}
    for size, row in pattern.pieces.items():
        made = []
        for piece in row:
            edges = [
                replace(edge, kind="hem", allowance=wish.width + _NARROW) if (piece.name, edge.name) in places else edge
                for edge in piece.edges
            ]
            made.append(replace(piece, edges=edges))
        pieces[size] = made
    return replace(pattern, pieces=pieces)


def _with_strip(pattern: Pattern, wish: Finishing, chain: FreeChain, count: int, cloth_width: float) -> Pattern:
    """Return a pattern with one strip along a chain of free edges, cut `count` times.

    A strip that is wider than the cloth is cut as equal panels, of which one is drawn. One that is laid in pleats begins and ends in the
    inner fold of a pleat, and so does each of its panels: no seam of them shows.
    """
    taken = {piece.name for piece in pattern.pieces[pattern.sample]}
    name = find_unused_name(wish.name, taken)
    ring = chain.closed and not wish.overlap
    lengths = {size: wish.share * chain_length(pattern, chain, size) for size in pattern.pieces}
    allowance = {
        size: pattern.piece(chain.sides[0].piece, size).edge(chain.sides[0].edge).width for size in pattern.pieces
    }
    folded, (weft, warp), _ = _STRIPS[wish.kind]
    high = wish.width * (2 if folded else 1)

    def width_of(panels: int) -> float:
        return max(
            warp * (length / panels + 2.0 * allowance[size]) + weft * (high + 2.0 * allowance[size])
            for size, length in lengths.items()
        )

    # What is cut along the cloth is as long as it likes.
    panels = panel_count(width_of, cloth_width) if warp > 0.0 and not wish.overlap else 1
    pieces = {
        size: (
            *row,
            _strip(
                wish, name, lengths[size] / panels, row[0],
                quantity=count * panels, joined=ring or panels > 1, allowance=allowance[size],
            ),
        )
        for size, row in pattern.pieces.items()
    }  # fmt: skip
    called, words = {seam.name for seam in pattern.seams}, name.replace("_", " ")
    sided = any(without_side(side.edge) != side.edge for side in chain.sides)
    whole = tuple(SeamSide(piece=name, edge="lower", copy=copy) for copy in range(panels))
    sides: tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]] = (whole, chain.sides)
    ease = 1.0 / wish.share - 1.0
    if wish.share > 1.0:
        sides, ease = sides[::-1], wish.share - 1.0
    sewn = Seam(name=find_unused_name(words, called), sides=sides, ease=ease)
    if wish.pleat:
        # Lengths of the strip and of its edge fit each other from pleat to pleat alone.
        size_notches = {}
        for size, length in lengths.items():
            row = _pleat_count(wish, length / panels)
            size_notches[size] = tuple((k + (row // 2) / row) / panels for k in range(panels) if row > 1)
        sewn = replace(sewn, notches=(), size_notches=size_notches)
    elif panels > 1:
        sewn = replace(sewn, notches=tuple((k + 0.5) / panels for k in range(panels)))
    else:
        sewn = replace(sewn, notches=None if sided else _centres(pattern, chain))
    seams = [*pattern.seams, sewn]
    called.add(sewn.name)
    for copy in range(panels if ring else panels - 1):
        ends = (
            (SeamSide(piece=name, edge="right end", copy=copy),),
            (SeamSide(piece=name, edge="left end", reversed=True, copy=(copy + 1) % panels),),
        )
        seams.append(
            Seam(name=find_unused_name(f"{words} ends", called), sides=ends, notches=() if wish.pleat else None)
        )
        called.add(seams[-1].name)
    return replace(pattern, pieces=pieces, seams=seams)


def _pleat_count(wish: Finishing, length: float) -> int:
    """Return how many pleats a panel of a strip of that length [m] is laid in."""
    return max(1, round(length / wish.share / wish.pleat))


def _centres(pattern: Pattern, chain: FreeChain) -> tuple[float, ...]:
    """Return the shares of a chain at the middles of the edges that cross a centre line; its joints are notched anyway.

    A piece that is printed half has the notch on its fold, and the strip has one for it.
    """
    lengths = [pattern.piece(side.piece, pattern.sample).edge(side.edge).length for side in chain.sides]
    ends = np.cumsum(lengths)
    whole = [centre_notch(pattern.piece(side.piece, pattern.sample)) is not None for side in chain.sides]
    return tuple(
        float((end - 0.5 * length) / ends[-1])
        for end, length, crosses in zip(ends, lengths, whole, strict=True)
        if crosses
    )


def _strip(
    wish: Finishing, name: str, length: float, like: Piece, *, quantity: int, joined: bool, allowance: float
) -> Piece:
    """Return a straight strip of one size, or a panel of one; `joined` are its ends to each other or to other panels."""
    folded, along, role = _STRIPS[wish.kind]
    high, whole = wish.width * (2 if folded else 1), length + wish.overlap
    # What is turned in has an allowance too, and no seam; a binding's other edge is folded over as it is cut.
    kinds = dict.fromkeys(("overlap", "upper"), "cut")
    kinds |= {} if joined else dict.fromkeys(("right end", "left end"), "cut")
    widths = dict.fromkeys(("lower", "right end", "left end", "upper", "overlap"), allowance)
    if wish.kind == "binding":
        widths["upper"] = 0.0
    elif wish.kind == "ruffle":
        kinds["upper"], widths["upper"] = "hem", _NARROW
    edges = strip_edges(*swept(Strip(length=length, height=high)), overlap=wish.overlap, kinds=kinds, allowance=widths)
    middle, reach = np.array([0.5 * whole, 0.5 * high]), 0.4 * (whole if along[1] == 0.0 else high)
    lines = {"fold line": np.array([[0.0, wish.width], [whole, wish.width]])} if folded else {}
    if wish.pleat:
        # Knife pleats: half of what each takes lies at either end of its stretch.
        count = _pleat_count(wish, length)
        stretch, hidden = length / count, 0.5 * length / count * (1.0 - 1.0 / wish.share)
        for number in range(count):
            for what, x in (("pleat lies here", hidden), ("pleat fold", stretch - hidden)):
                x += number * stretch
                lines[f"{what} {number + 1}"] = np.array([[x, 0.0], [x, high]])
    marks = {}
    if wish.overlap:
        # It buttons upon itself, in the middle of its outer half.
        marks["button"] = np.array([length + 0.5 * wish.overlap, 0.5 * wish.width])
        lines |= buttonhole(np.array([0.5 * wish.overlap, 0.5 * wish.width]), np.array([1.0, 0.0]))
    return Piece(
        name=name, size=like.size, fabric=like.fabric, quantity=quantity, edges=edges, internal_lines=lines,
        grain=middle + np.outer([-reach, reach], along), paired=False, role=role, marks=marks,
    )  # fmt: skip
