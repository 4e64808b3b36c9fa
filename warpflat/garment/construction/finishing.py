"""Finishing of a pattern's own free edges: facings, bands, waistbands, cuffs, ruffles, collars, hoods, casings and slanted hems."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, nearest, without_side
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.collars import with_collar, with_hood
from warpflat.garment.construction.details import FinishingTable
from warpflat.garment.construction.edges import (
    Place,
    added,
    changed,
    drawn_on,
    free_piece_name,
    lengths_of,
    new_piece,
    sewn,
    sewn_places,
)
from warpflat.garment.construction.facings import (
    STAND,
    Stand,
    centre_notch,
    is_beside,
    with_facings,
    with_stand_facings,
)
from warpflat.garment.construction.flounces import with_flounce
from warpflat.garment.construction.free_edges import (
    Break,
    FreeChain,
    chain_allowance,
    chain_length,
    free_chains,
    marks_of,
)
from warpflat.garment.construction.plackets import with_placket, with_slits
from warpflat.garment.construction.shaped_band import shortened, slant_rises, with_shaped_waistband
from warpflat.garment.construction.strips import NARROW, Strip, panel_count
from warpflat.pattern import CLOTH_WIDTH, Edge, Elastic, Pattern, Piece, SeamSide, line_name

__all__ = ["finish_edges", "hem_rises"]

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


def finish_edges(
    pattern: Pattern,
    finishing: Sequence[FinishingTable],
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
        with _said_of(number):
            pattern, places = _opened_up(pattern, wish.edge, sewn_there=wish.kind != "hem")
            if wish.shorten:
                pattern = shortened(pattern, places, wish.shorten)
            if wish.kind == "facing":
                faced |= {stand for stand in stands for place in places if is_beside(pattern, stand, place)}
    pattern = with_stand_facings(pattern, [stand for stand in stands if stand not in faced])
    for number, wish in enumerate(finishing):
        if wish.kind == "hem":
            continue
        with _said_of(number):
            pattern, places = _opened_up(pattern, wish.edge)
            if wish.elastic:
                # Around one limb where the edge has a side.
                levels = [places[0][1], wish.edge, f"{wish.edge} left"]
                lengths = {size: wish.elastic * _girth_at(size, levels, girths or {}) for size in pattern.pieces}
                # One on each side of the body, or one.
                count = 2 if any(without_side(edge) != edge for _, edge in places) else 1
                elastic = Elastic(edge=wish.edge, width=wish.width, lengths=lengths, count=count)
                pattern = replace(pattern, elastics=(*pattern.elastics, elastic))
            breaks = list[Break]()
            if wish.kind == "facing":
                pattern = with_facings(pattern, places, wish.width, gaps=gaps, stands=stands)
            elif wish.kind == "hood":
                heads = {size: _girth_at(size, ["head"], girths or {}) for size in pattern.pieces}
                pattern = with_hood(pattern, places, wish, heads, gaps=gaps)
            elif wish.kind == "collar" and wish.style != "turtleneck":
                if wish.placket:
                    pattern, breaks = with_placket(pattern, places, wish.placket, wish.edge)
                    pattern, places = _opened_up(pattern, wish.edge)
                pattern = with_collar(pattern, places, wish, gaps=gaps, breaks=breaks)
            elif wish.kind == "casing":

                def turned_in(_: Piece, edge: Edge, wide: float = wish.width + NARROW) -> list[Edge]:
                    # With an allowance of its width, and the edge turned in once more.
                    return [replace(edge, kind="hem", allowance=wide)]

                for place in places:
                    pattern = changed(pattern, place, turned_in)
            elif wish.shaped:
                pattern = with_shaped_waistband(pattern, places, wish.width, gaps=gaps)
            else:
                if wish.placket:
                    pattern, breaks = with_slits(pattern, places, wish.placket)
                    pattern, places = _opened_up(pattern, wish.edge)
                for chain, count in free_chains(pattern, places, gaps, breaks):
                    if wish.kind == "flounce":
                        pattern = with_flounce(pattern, chain, wish.width, wish.turns, wish.edge, cloth_width)
                    else:
                        pattern = _with_strip(pattern, wish, chain, count, cloth_width, stands)
    return pattern


@contextmanager
def _said_of(number: int) -> Iterator[None]:
    """Say which finishing an error is about."""
    try:
        yield
    except InputError as error:
        raise InputError(f"finishing[{number}]: {error}") from None


def hem_rises(pattern: Pattern, finishing: Sequence[FinishingTable]) -> dict[Place, tuple[FloatArray, FloatArray]]:
    """Return how wide a strip slanted hems lose in the sample size, as :func:`slant_rises` gives it."""
    found = dict[Place, tuple[FloatArray, FloatArray]]()
    for number, wish in enumerate(finishing):
        if isinstance(wish.shorten, Mapping):
            with _said_of(number):
                places = _opened_up(pattern, wish.edge, sewn_there=False)[1]
                found |= slant_rises(pattern, places, wish.shorten, pattern.sample)
    return found


def _opened_up(pattern: Pattern, called: str, *, sewn_there: bool = True) -> tuple[Pattern, list[Place]]:
    """Return the free edges of a name, and the pattern with those that were hems as edges to be sewn, unless they stay hems.

    Raises:
        InputError: there is none; gives the nearest.
    """
    taken = sewn_places(pattern)
    free = {
        (piece.name, edge.name): edge.kind
        for piece in pattern.pieces[pattern.sample]
        for edge in piece.edges
        if (piece.name, edge.name) not in taken
        and (edge.kind == "seam" or (edge.kind == "hem" and piece.role == "shell"))
    }
    names = {edge: line_name(edge) for _, edge in free}
    places = [place for place in free if names[place[1]] == called]
    if not places:
        raise InputError(f"no free edge {called!r}; {nearest(called, set(names.values()))}")

    def opened(piece: Piece, edge: Edge) -> list[Edge]:
        # As wide as the allowance of the piece's other seams.
        width = next((each.width for each in piece.edges if each.kind == "seam"), None)
        return [replace(edge, kind="seam", allowance=width)]

    for place in places:
        if free[place] == "hem" and sewn_there:
            pattern = changed(pattern, place, opened)
    return pattern, places


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


def _with_strip(
    pattern: Pattern, wish: FinishingTable, chain: FreeChain, count: int, cloth_width: float, stands: Sequence[Stand]
) -> Pattern:
    """Return a pattern with one strip along a chain of free edges, cut `count` times.

    Along button stands it laps as they do, and buttons where they button; else what runs past its end has the button.
    A strip that is wider than the cloth is cut as equal panels, of which one is drawn. One that is laid in pleats begins and ends in the
    inner fold of a pleat, and so does each of its panels: no seam of them shows.
    """
    name = free_piece_name(pattern, wish.name)
    lengths = {size: wish.share * chain_length(pattern, chain, size) for size in pattern.pieces}
    allowances = {size: chain_allowance(pattern, chain, size) for size in pattern.pieces}
    folded, (weft, warp), role = _STRIPS[wish.kind]
    high = wish.width * (2 if folded else 1)
    # Where the lines along which it buttons meet the edge.
    centres = {stand.edge.removesuffix(f" {STAND}") for stand in stands if wish.overlap and not chain.closed}
    lapped = {
        size: sorted(wish.share * at for line in centres for at in marks_of(pattern, chain, size, line))
        for size in pattern.pieces
    }
    on_stands = all(len(row) > 1 for row in lapped.values())
    overlap = 0.0 if on_stands else wish.overlap

    def width_of(panels: int) -> float:
        return max(
            warp * (length / panels + 2.0 * allowances[size]) + weft * (high + 2.0 * allowances[size])
            for size, length in lengths.items()
        )

    # What is cut along the cloth is as long as it likes.
    panels = panel_count(width_of, cloth_width) if warp > 0.0 and not wish.overlap else 1
    ring = chain.closed and not wish.overlap
    # What is turned in has an allowance too, and no seam; a binding's other edge is folded over as it is cut.
    ends = "seam" if ring or panels > 1 else "cut"

    def strip(like: Piece) -> Piece:
        length, allowance = lengths[like.size] / panels, allowances[like.size]
        upper = {"binding": ("cut", 0.0), "ruffle": ("hem", NARROW)}.get(wish.kind, ("cut", allowance))
        edges = Strip(length=length, height=high).edges(
            overlap=overlap,
            kinds={"overlap": "cut", "upper": upper[0], "right end": ends, "left end": ends},
            allowance={**dict.fromkeys(("lower", "right end", "left end", "overlap"), allowance), "upper": upper[1]},
        )
        whole = length + overlap
        middle, reach = np.array([0.5 * whole, 0.5 * high]), 0.4 * (whole if warp == 0.0 else high)
        drawn = {"fold line": np.array([[0.0, wish.width], [whole, wish.width]])} if folded else {}
        if wish.pleat:
            # Knife pleats: half of what each takes lies at either end of its stretch.
            pleats = _pleat_count(wish, length)
            stretch, hidden = length / pleats, 0.5 * length / pleats * (1.0 - 1.0 / wish.share)
            for number in range(pleats):
                for what, x in (("pleat lies here", hidden), ("pleat fold", stretch - hidden)):
                    x += number * stretch
                    drawn[f"{what} {number + 1}"] = np.array([[x, 0.0], [x, high]])
        made = new_piece(
            name, like, edges, role, quantity=count * panels, internal_lines=drawn,
            grain=middle + np.outer([-reach, reach], (weft, warp)),
        )  # fmt: skip
        if wish.overlap:
            # It buttons upon itself, in the middle of its outer half; which end has what on stands is said of those.
            hole, *_, button = lapped[like.size] if on_stands else (0.5 * overlap, length + 0.5 * overlap)
            for at, there in ((button, hole), (hole, button))[: 2 if on_stands else 1]:
                lines = buttonhole(np.array([there, 0.5 * wish.width]), np.array([1.0, 0.0]))
                made = drawn_on(made, lines.items(), [("button", np.array([at, 0.5 * wish.width]))])
        return made

    pattern = added(pattern, strip)
    size_notches: dict[str, tuple[float, ...]] = {}
    notches: tuple[float, ...] | None = None
    if all(without_side(side.edge) == side.edge for side in chain.sides):
        # In the middles of the edges that cross a centre line; their joints are notched anyway. A piece that is printed half has the notch
        # on its fold, and the strip has one for it.
        along = np.array(lengths_of(pattern, chain.sides))
        middles = ((np.cumsum(along) - 0.5 * along) / along.sum()).tolist()
        whole_pieces = [centre_notch(pattern.piece(side.piece, pattern.sample)) is not None for side in chain.sides]
        notches = tuple(at for at, crosses in zip(middles, whole_pieces, strict=True) if crosses)
    if wish.pleat:
        # Lengths of the strip and of its edge fit each other from pleat to pleat alone.
        notches = ()
        for size, length in lengths.items():
            row = _pleat_count(wish, length / panels)
            size_notches[size] = tuple((k + (row // 2) / row) / panels for k in range(panels) if row > 1)
    elif panels > 1:
        notches = tuple((k + 0.5) / panels for k in range(panels))
    whole = tuple(SeamSide(piece=name, edge="lower", copy=copy) for copy in range(panels))
    # The second side is the longer one.
    sides, longer = ((chain.sides, whole), wish.share) if wish.share > 1.0 else ((whole, chain.sides), 1.0 / wish.share)
    pattern = sewn(pattern, name, *sides, ease=longer - 1.0, notches=notches, size_notches=size_notches)
    for copy in range(panels if ring else panels - 1):
        following = SeamSide(piece=name, edge="left end", reversed=True, copy=(copy + 1) % panels)
        end = SeamSide(piece=name, edge="right end", copy=copy)
        pattern = sewn(pattern, f"{name} ends", end, following, notches=() if wish.pleat else None)
    return pattern


def _pleat_count(wish: FinishingTable, length: float) -> int:
    """Return how many pleats a panel of a strip of that length [m] is laid in."""
    return max(1, round(length / wish.share / wish.pleat))
