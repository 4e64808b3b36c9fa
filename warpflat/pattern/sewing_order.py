"""The order in which a garment is sewn, read off its darts, seams and free edges, with a letter for each seam."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase

from warpflat.core.polyline import polyline_length
from warpflat.core.text import other_side, without_side
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.measures import length_words
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamOpening, SeamSide
from warpflat.pattern.seam_rings import seam_rings
from warpflat.pattern.seam_words import joint_words
from warpflat.pattern.words import listed, translate, translate_name

__all__ = [
    "SewingStep",
    "SewnSeam",
    "notions",
    "piece_titles",
    "seam_letters",
    "sewing_steps",
    "sewn_seams",
    "tools",
]


#: Seams of the shell in the order in which they are closed, by words of their names; what has none of them comes with the panels.
_STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Make the pockets", ("pocket",)),
    ("Join the panels", ("princess", "panel", "yoke", "centre")),
    ("Sew the shoulders", ("shoulder",)),
    ("Sew the inner leg seams", ("inseam",)),
    ("Sew the side seams", ("side", "outseam")),
    ("Sew the godets in, from the tip to the hem", ("godet",)),
    ("Sew the sleeve seams", ("underarm", "overarm")),
    ("Sew the crotch seam", ("crotch",)),
    ("Sew around, onto what is joined", ()),
    ("Join the panels of the flounces", ()),
    ("Join at the waist", ("waist", "hip", "abdomen", "underbust")),
    ("Sew the flounces on", ()),
    ("Set the sleeves in", ("armhole",)),
    ("Attach the collar", ("neck", "collar")),
)
#: Then those of other pieces, by the roles of the pieces on both sides.
_FINISHING: tuple[tuple[str, tuple[set[str], ...]], ...] = (
    ("Join the facings", ({"facing"},)),
    ("Sew the facings to their edges, turn them in and press them", ({"facing", "shell"},)),
    ("Join the linings", ({"lining"},)),
    ("Sew the lining to the facings", ({"facing", "lining"},)),
    ("Join the ends of bands and bindings", ({"strip"}, {"waistband"})),
    ("", ({"strip", "shell"},)),
    ("", ({"waistband", "shell"}, {"strip", "waistband"})),
    ("Sew the cuffs on, fold them right sides together, sew their ends and turn them", ({"cuff", "shell"}, {"cuff"})),
    ("Sew the hood's own seams", ({"hood"},)),
    ("Sew the hood on", ({"hood", "shell"},)),
    ("Make up the collar, right sides together, and turn it", ({"collar"},)),
    ("Sew the collar on", ({"collar", "shell"},)),
)
# A seam of these stages is mentioned by others.
_AROUND, _FLOUNCES, _ON_FLOUNCES = 8, 9, 11
_ON_FACINGS, _LININGS, _BAND_ENDS, _ON_BANDS, _WAISTBANDS = (len(_STAGES) + k for k in (1, 2, 4, 5, 6))
#: How a strip is joined of panels, and how one is sewn on that is folded lengthwise, has a hem of its own, or is folded over the raw edge.
_FOLDED = "Fold the bands lengthwise, wrong sides together, and sew both their edges on"
_PANELS = "Join the panels of ruffles and bands at their ends, and press the seams open"
_HEMMED = "Sew the ruffles on"
_BOUND = "Sew the bindings on, fold them over the raw edges and sew them down inside"
#: How a waistband is: one that is folded, with ends or as a ring; and one that is cut in two layers.
_WITH_ENDS = "Sew the waistband on, fold it right sides together, sew its ends, turn it and sew its inner edge down"
_RING = "Sew the waistband on, turn it in and sew its inner edge down"
_LAYERS = "Sew one layer of the waistband on, sew the other to it along the upper edge and open ends, turn it in and sew it down"


# What is longer by more than this share is gathered; less is eased in.
_GATHERED = 0.15

#: A piece and an edge of it, by their names.
Place = tuple[str, str]


@dataclass(frozen=True, kw_only=True)
class SewingStep:
    """A step of making a garment.

    Attributes:
        words: a sentence.
        sewn: of each piece that is at work, by its name, the edges that are sewn; fisheye darts among them.
    """

    words: str
    sewn: Mapping[str, frozenset[str]]

    @classmethod
    def at(cls, words: str, places: Iterable[Place] = (), pieces: Iterable[DraftedPiece] = ()) -> SewingStep:
        """Return a step that sews at some places, and at which further pieces are handled."""
        sewn: dict[str, set[str]] = {piece.name: set() for piece in pieces}
        for piece, edge in places:
            sewn.setdefault(piece, set()).add(edge)
        return cls(words=words, sewn={piece: frozenset(edges) for piece, edges in sewn.items()})


@dataclass(frozen=True, kw_only=True)
class SewnSeam:
    """A seam as the maker meets it; its mirror image, which is sewn alike, is the same one.

    Attributes:
        letter: written beside its notches.
        name: without left and right, if both are sewn.
        sides: the pieces of both sides, in words.
        length_mm: of both sides.
        ease: by how much the second side is longer than the first, as a share.
        stretched: whether the shorter side is a band, which is stretched to the other.
        pleated: whether the longer side is laid in pleats.
        by_pieces: whether it is called by the pieces that it joins.
        ring: the number of the ring that it is part of, where seams are called by their pieces; None of others.
        stage: its place in `_STAGES` and `_FINISHING`.
        count: how often it is sewn.
        openings: where it can be opened, or is not closed.
        places: piece and edge of all that it joins, of both sides of the body.
    """

    letter: str
    name: str
    sides: tuple[str, str]
    length_mm: tuple[float, float]
    ease: float
    stretched: bool
    pleated: bool
    by_pieces: bool
    ring: int | None
    stage: int
    count: int
    openings: tuple[SeamOpening, ...]
    places: tuple[Place, ...]

    def words(self) -> str:
        """Return its letter, its name, its pieces, and how its longer or shorter side is held."""
        first, second = self.sides
        if self.by_pieces:
            words = translate("{first} to {second}", first=first, second=second)
            if first == second:
                words = translate("seam of the {first}", first=first)
        elif first != second:
            words = translate("{seam}: {first} to {second}", seam=self.name, first=first, second=second)
        else:
            words = self.name if first in self.name else translate("{seam} of the {first}", seam=self.name, first=first)
        if abs(self.ease) >= 5e-4 and not self.pleated:
            longer, shorter = (second, first) if self.ease > 0 else (first, second)
            share = self.ease if self.ease > 0 else 1.0 / (1.0 + self.ease) - 1.0
            if self.stretched:
                words += translate(", stretch the {piece}", piece=shorter)
            else:
                words += translate(f", {'gather' if share > _GATHERED else 'ease in'} the {{piece}}", piece=longer)
        return f"{self.letter} ({words})"


def piece_titles(pieces: Sequence[Piece]) -> dict[str, str]:
    """Return what each piece is called: as it is printed, with its side where two would be called alike."""
    plain = [piece.printed_name for piece in pieces]
    return {
        piece.name: title if plain.count(title) == 1 or piece.title else translate_name(piece.name.replace("_", " "))
        for piece, title in zip(pieces, plain, strict=True)
    }


def sewn_seams(garment: DraftedGarment, size: str) -> tuple[SewnSeam, ...]:
    """Return the seams of a garment in their order, each with its letter."""
    pieces = {piece.name: piece.piece for piece in garment.pieces[size]}
    titles = piece_titles(list(pieces.values()))
    lengths = {report.name: report.length_mm for report in garment.seams if report.size == size}
    rings, names = _rings(garment.garment), {seam.name for seam in garment.garment.seams}
    groups = _mirror_groups(garment.garment.seams, pieces, rings)
    found = list[SewnSeam]()
    for number, group in enumerate(groups):
        seam = group[0]
        # Of halves on the fold and of pairs the seam of one side stands for both, but for a zip, which is in one of them.
        joined = [pieces[side.piece] for row in seam.sides for side in row]
        other, both = other_side(seam.name), all(piece.on_fold or piece.is_pair for piece in joined)
        stands_for_both = both and len(group) == 1 and other not in names and other != seam.name
        sideless = len(group) > 1 or (stands_for_both and not seam.openings)
        places = [(side.piece, side.edge) for each in group for row in each.sides for side in row]
        if any(pieces[piece].quantity % 2 == 0 for piece, _ in places):
            # What is cut twice is drawn for one side, and sewn to both.
            places += [(piece, other_side(edge)) for piece, edge in places if pieces[piece].quantity == 1]
        found.append(
            SewnSeam(
                letter=_letter(number),
                name=translate_name(without_side(seam.name) if sideless else seam.name),
                sides=(_words(seam.sides[0], titles), _words(seam.sides[1], titles)),
                length_mm=lengths.get(seam.name, (0.0, 0.0)),
                ease=seam.ease,
                stretched=pieces[seam.sides[0 if seam.ease > 0 else 1][0].piece].role == "strip",
                pleated=any("pleat fold" in name for piece in joined for name in piece.internal_lines),
                by_pieces=_is_by_pieces(seam),
                ring=rings.get(seam.name),
                stage=_stage(seam, pieces, rings),
                count=max(len(group), 2 if sideless else 1),
                openings=seam.openings,
                places=tuple(places),
            )
        )
        if stands_for_both and seam.openings:
            found.append(replace(found[-1], name=translate_name(other), openings=()))
    return tuple(found)


def seam_letters(garment: DraftedGarment) -> dict[str, str]:
    """Return the letter of each seam by its name."""
    size = next(iter(garment.pieces))
    pieces = {piece.name: piece.piece for piece in garment.pieces[size]}
    groups = _mirror_groups(garment.garment.seams, pieces, _rings(garment.garment))
    return {seam.name: _letter(number) for number, group in enumerate(groups) for seam in group}


def sewing_steps(garment: DraftedGarment, size: str) -> tuple[SewingStep, ...]:
    """Return the steps of making the garment."""
    pieces = garment.pieces[size]
    titles = piece_titles([piece.piece for piece in pieces])
    units, steps = garment.garment.units, list[SewingStep]()

    def called(places: Iterable[Place | DraftedPiece]) -> str:
        names = (place.name if isinstance(place, DraftedPiece) else place[0] for place in places)
        return ", ".join(dict.fromkeys(titles[name] for name in names))

    tied = [piece for piece in pieces if "tie" in piece.piece.marks]
    if tied:
        ties = [piece for piece in pieces if piece.name == "tie"]
        steps.append(
            SewingStep.at(
                translate(
                    "Fold the ties lengthways, sew and turn them. One is caught in the wrap edge of each front where it is marked; leave a "
                    "gap in the right side seam there for the inner one: {pieces}.",
                    pieces=called(tied),
                ),
                pieces=[*ties, *tied],
            )
        )
    fused = [piece for piece in pieces if piece.piece.also or piece.piece.role == "interfacing"]
    if fused:
        steps.append(SewingStep.at(translate("Fuse the interfacing: {pieces}.", pieces=called(fused)), pieces=fused))
    for pleats, phrase in (
        (False, "Sew the darts, from the edge to the tip, and press them: {darts}."),
        (True, "Fold the pleats and sew them as far as they are marked; they hang open below: {pleats}."),
    ):
        legs = {piece.name: _dart_legs(piece, pleats=pleats) for piece in pieces}
        words = [f"{titles[piece]}: {listed(list(of_piece))}" for piece, of_piece in legs.items() if of_piece]
        if words:
            places = [(piece, leg) for piece, of_piece in legs.items() for row in of_piece.values() for leg in row]
            steps.append(SewingStep.at(translate(phrase, darts="; ".join(words), pleats="; ".join(words)), places))
    joined = {side.piece for seam in garment.garment.seams for row in seam.sides for side in row}
    # A pocket of a first project is a panel like others, but nothing is sewn to its edges.
    patches = [
        piece
        for piece in pieces
        if (piece.piece.role == "pocket" or (piece.name.endswith("pocket") and piece.name not in joined))
        and any(edge.kind == "hem" for edge in piece.edges)
    ]
    if patches:
        steps.append(
            SewingStep.at(
                translate(
                    "Hem the upper edges of the patch pockets, turn in the others and sew them to their marks: {pockets}.",
                    pockets=called(patches),
                ),
                [(piece.name, edge.name) for piece in patches for edge in piece.edges if edge.kind == "seam"],
                patches,
            )
        )
    welts = [piece for piece in pieces if "_pocket_welt" in piece.name]
    if welts:
        steps.append(
            SewingStep.at(
                translate(
                    "Sew a folded welt and a bag to each marked place, cut between the seams, turn the bags in and close them: {pockets}.",
                    pockets=called(welts),
                ),
                pieces=welts,
            )
        )
    straps = [
        piece
        for piece in pieces
        if piece.piece.role == "shell" and piece.name not in joined and all(edge.kind == "cut" for edge in piece.edges)
    ]
    if straps:
        steps.append(
            SewingStep.at(
                translate(
                    "Press the long edges of the straps to their middle, fold them along it, sew them, and sew on their "
                    "ends last: {straps}.",
                    straps=called(straps),
                ),
                pieces=straps,
            )
        )
    buttoned = [piece for piece in pieces if "_placket" in piece.name and "button" in piece.piece.marks]
    if buttoned:
        steps.append(
            SewingStep.at(
                translate(
                    "Sew a strip to each side of the marked box, cut the slit and into the corners, turn the strips in, fold them, lay the "
                    "right one over the left and sew their lower ends down: {plackets}.",
                    plackets=called(buttoned),
                ),
                pieces=buttoned,
            )
        )
    placket = [piece for piece in pieces if "_placket" in piece.name and piece not in buttoned]
    if placket:
        steps.append(
            SewingStep.at(
                translate(
                    "Cut the slits where they are marked, and bind both their edges with one strip each: {plackets}.",
                    plackets=called(placket),
                ),
                pieces=placket,
            )
        )
    seams = sewn_seams(garment, size)
    # Edges of linings and facings that no seam takes: they end at a zip, are caught in a binding, or are finished by themselves.
    free = _free_edges(pieces, garment.garment.seams)
    roles = {piece.name: piece.piece.role for piece in pieces}
    zipped = {
        without_side(side.edge)
        for seam in garment.garment.seams
        for row in seam.sides
        for side in row
        if any(each.kind == "zip" for each in seam.openings)
    }
    bound = {
        without_side(edge)
        for seam in seams
        if seam.stage in (_ON_BANDS, _WAISTBANDS)
        for piece, edge in seam.places
        if roles.get(piece) == "shell"
    }
    inside = {edge: [place for place in row if roles[place[0]] in ("lining", "facing")] for edge, row in free.items()}
    at_zip = [place for edge, row in inside.items() if edge in zipped for place in row]
    basted = {edge: row for edge, row in inside.items() if edge in bound and row}
    turned_in_at = max((each.stage for each in seams if each.stage in (_LININGS + 1, _ON_FACINGS)), default=None)
    stages = sorted({seam.stage for seam in seams})
    by_name = {piece.name: piece for piece in pieces}
    rings = {piece for seam in seams if seam.stage == _BAND_ENDS for piece, _ in seam.places}

    def phrase_of(seam: SewnSeam) -> str:
        """Return how a seam is sewn: by its stage, and by what a strip or a waistband is like."""
        strips = [by_name[piece] for piece, _ in seam.places if roles.get(piece) in ("strip", "waistband")]
        if seam.stage == _WAISTBANDS:
            if not any("fold line" in strip.internal_lines for strip in strips):
                return _LAYERS
            return _RING if any(strip.name in rings for strip in strips) else _WITH_ENDS
        if seam.stage == _BAND_ENDS and seam.count > 1:
            return _PANELS
        if seam.stage != _ON_BANDS:
            return [*_STAGES, *_FINISHING][seam.stage][0]
        if any(edge.kind == "hem" for strip in strips for edge in strip.edges):
            return _HEMMED
        return _FOLDED if any("fold line" in strip.internal_lines for strip in strips) else _BOUND

    first_band = next((stage for stage in stages if stage in (_ON_BANDS, _WAISTBANDS)), None)
    # Ruffles are joined, hemmed and laid in pleats or gathered before they are sewn on.
    ruffles = [
        piece for piece in pieces if piece.piece.role == "strip" and any(edge.kind == "hem" for edge in piece.edges)
    ]
    pleated = [piece for piece in ruffles if any("pleat fold" in name for name in piece.piece.internal_lines)]
    longer = {piece for seam in seams if seam.stage == _ON_BANDS and seam.ease > _GATHERED for piece, _ in seam.places}
    gathered = [piece for piece in ruffles if piece not in pleated and piece.name in longer]
    for stage in stages:
        here = [seam for seam in seams if seam.stage == stage]
        if stage == _ON_BANDS:
            hems = [(piece.name, edge.name) for piece in ruffles for edge in piece.edges if edge.kind == "hem"]
            for phrase, row, places in (
                ("Hem the free edges of the ruffles: {pieces}.", ruffles, hems),
                ("Lay the pleats, each fold to the line beside it, press and baste them: {pieces}.", pleated, []),
                ("Sew two rows of long stitches along the edge, and draw it up: {pieces}.", gathered, []),
            ):
                if row:
                    steps.append(SewingStep.at(translate(phrase, pieces=called(row)), places, row))
        if basted and stage == first_band:
            steps.append(
                SewingStep.at(
                    translate(
                        "Baste the lining to the shell, wrong sides together: {edges}.",
                        edges=", ".join(translate_name(edge) for edge in basted),
                    ),
                    [place for row in basted.values() for place in row],
                )
            )
        plain = [seam for seam in here if not seam.openings or stage == _LININGS]
        for seam in (seam for seam in here if seam not in plain):
            steps += [SewingStep.at(words, seam.places) for words in _opened_steps(seam, units)]
        by_phrase: dict[tuple[str, int | None], list[SewnSeam]] = {}
        for seam in plain:
            by_phrase.setdefault((phrase_of(seam), seam.ring), []).append(seam)
        for (what, _), alike in by_phrase.items():
            words = [seam.words() + (translate(", open beside the zip") if _zips(seam) else "") for seam in alike]
            steps.append(
                SewingStep.at(
                    translate("{what}, notch to notch: {seams}.", what=translate(what), seams=", ".join(words)),
                    [place for seam in alike for place in seam.places],
                )
            )
        if stage == _LININGS:
            at_zip += [place for seam in here if _zips(seam) for place in seam.places]
        if stage == turned_in_at and at_zip:
            steps.append(
                SewingStep.at(
                    translate(
                        "At the zip, turn in the edges and sew them to its tape by hand: {pieces}.",
                        pieces=called(at_zip),
                    ),
                    at_zip,
                )
            )
    done = {*at_zip, *(place for row in basted.values() for place in row)}
    done |= {(piece.name, edge.name) for piece in patches for edge in piece.edges}
    left = {edge: rest for edge, row in free.items() if (rest := [place for place in row if place not in done])}
    if left:
        words = [f"{translate_name(edge)} ({called(row)})" for edge, row in left.items()]
        steps.append(
            SewingStep.at(
                translate("Finish the raw edges with a facing, a band or binding: {edges}.", edges="; ".join(words)),
                [place for row in left.values() for place in row],
            )
        )
    # Slits and vents are hems of their own, which the steps of their seams have turned in.
    turned_up: dict[float, list[Place]] = {}
    opened, cased = {"slit", "vent"}, {elastic.edge for elastic in garment.garment.elastics}
    pockets = {piece.name for piece in patches}
    for piece in (piece for piece in pieces if piece.piece.role != "pocket" and piece.name not in pockets):
        for edge in piece.edges if piece not in ruffles else ():
            name = without_side(edge.name).rstrip(" 0123456789")
            if edge.kind == "hem" and name not in cased and not opened & set(edge.name.split(" ")):
                turned_up.setdefault(round(edge.width, 4), []).append((piece.name, edge.name))
    flounces = [piece for piece in pieces if piece.piece.role == "shell" and is_flounce(piece.piece)]
    if flounces:
        phrase = "Let the flounces hang for a day, and even their hems: {pieces}."
        steps.append(SewingStep.at(translate(phrase, pieces=called(flounces)), pieces=flounces))
    if turned_up:
        words = [f"{length_words(width, units)} ({called(row)})" for width, row in turned_up.items()]
        steps.append(
            SewingStep.at(
                translate("Turn up and sew the hems: {edges}.", edges=", ".join(words)),
                [place for row in turned_up.values() for place in row],
            )
        )
    for kind in ("vent", "slit"):
        lined = [
            (piece.name, edge.name)
            for piece in pieces
            for edge in piece.edges
            if piece.piece.role == "lining" and edge.kind == "hem" and kind in edge.name.split(" ")
        ]
        if lined:
            phrase = f"At the {kind}, turn in the edges of the lining and sew them to the shell by hand: {{pieces}}."
            steps.append(SewingStep.at(translate(phrase, pieces=called(lined)), lined))
    for elastic in garment.garment.elastics:
        cased_edges = [
            (piece.name, edge)
            for piece in pieces
            for edge in piece.edges
            if without_side(edge.name).rstrip(" 0123456789") == elastic.edge
        ]
        # Without a strip of its own the edge is turned in.
        turned_in = any(edge.kind == "hem" for _, edge in cased_edges)
        phrase = "Turn in the {edge} as a casing of {width}" if turned_in else "Fold the band of the {edge} to {width}"
        steps.append(
            SewingStep.at(
                translate(
                    f"{phrase}, leave a gap in its seam, thread elastic of {{length}} through it, and close both.",
                    edge=translate_name(elastic.edge),
                    width=length_words(elastic.width, units),
                    length=length_words(elastic.lengths[size], units),
                ),
                [(piece, edge.name) for piece, edge in cased_edges],
            )
        )
    for title, count in _buttons(pieces).items():
        steps.append(
            SewingStep.at(
                translate(
                    "Work the buttonholes on the right half, and sew {count} buttons to the left one: {title}.",
                    count=count,
                    title=title,
                ),
                pieces=[piece for piece in pieces if titles[piece.name] == title],
            )
        )
    ends = [piece for piece in pieces if _buttons_at_one_end(piece)]
    if ends:
        steps.append(
            SewingStep.at(
                translate(
                    "Work a buttonhole at one end, and sew a button to the other: {pieces}.", pieces=called(ends)
                ),
                pieces=ends,
            )
        )
    hooked = _hooked(garment, size)
    if hooked:
        steps.append(
            SewingStep.at(
                translate("Sew a hook and bar to the ends above the zip: {pieces}.", pieces=called(hooked)),
                pieces=hooked,
            )
        )
    return tuple(steps)


def notions(garment: DraftedGarment, size: str) -> tuple[str, ...]:
    """Return what is needed beside the cloth: thread, zips, elastics and buttons."""
    units = garment.garment.units
    zips = [
        translate(
            f"{{count}} {opening.style} {'zip' if seam.count == 1 else 'zips'} of {{length}}",
            count=seam.count,
            length=length_words(opening.length, units),
        )
        for seam in sewn_seams(garment, size)
        for opening in _zips(seam)
        if seam.stage < len(_STAGES)
    ]
    elastics = [
        translate(
            f"{{count}} {'elastic' if elastic.count == 1 else 'elastics'} of {{length}}, at most {{width}} wide",
            count=elastic.count,
            length=length_words(elastic.lengths[size], units),
            width=length_words(elastic.width, units),
        )
        for elastic in garment.garment.elastics
    ]
    pieces = garment.pieces[size]
    titles = piece_titles([piece.piece for piece in pieces])
    buttons = []
    for title, count in _buttons(pieces).items():
        lines = [piece.internal_lines.get("buttonhole") for piece in pieces if titles[piece.name] == title]
        holes = [polyline_length(line) for line in lines if line is not None]
        words = translate("{count} buttons", count=count)
        if holes:
            words += translate(", for buttonholes of {length}", length=length_words(holes[0], units))
        buttons.append(words)
    # Both layers of a collar have one button.
    small = sum(
        piece.piece.quantity // (2 if piece.piece.role == "collar" else 1)
        for piece in pieces
        if _buttons_at_one_end(piece)
    )
    return (
        translate("sewing thread"),
        *zips,
        *elastics,
        *buttons,
        *(translate("1 hook and bar") for _ in _hooked(garment, size)),
        *([translate("{count} small buttons" if small > 1 else "1 small button", count=small)] if small else []),
    )


def _hooked(garment: DraftedGarment, size: str) -> list[DraftedPiece]:
    """Return the waistbands that close above a zip without a button."""
    zipped = any(_zips(seam) for seam in sewn_seams(garment, size))
    bands = [piece for piece in garment.pieces[size] if piece.piece.role == "waistband"]
    return [piece for piece in bands if zipped and not any(name.startswith("button") for name in piece.piece.marks)]


def _buttons_at_one_end(piece: DraftedPiece) -> bool:
    """Return whether a strip buttons upon itself: a cuff, or the stand of a collar."""
    return piece.piece.role in ("cuff", "collar", "waistband") and "button" in piece.piece.marks


def tools(garment: DraftedGarment, size: str) -> str:
    """Return what the garment is made with, in words."""
    needed = [
        "paper scissors and glue or tape",
        "cloth scissors",
        "tape measure",
        "chalk",
        "pins",
        "iron",
        "sewing machine",
        "hand needle",
    ]
    if any(_zips(seam) for seam in sewn_seams(garment, size)):
        needed.append("zip foot")
    if _buttons(garment.pieces[size]) or any(map(_buttons_at_one_end, garment.pieces[size])):
        needed.append("buttonhole foot")
    if garment.garment.worn is not None and garment.garment.worn.knits:
        needed.append("needle and stitch for knits")
    return ", ".join(translate(word) for word in needed)


def _buttons(pieces: Sequence[DraftedPiece]) -> dict[str, int]:
    """Return the number of buttons by the printed name of the piece that has them."""
    pieces = [piece for piece in pieces if not _buttons_at_one_end(piece)]
    titles = piece_titles([piece.piece for piece in pieces])
    counts = {titles[piece.name]: sum(name.startswith("button") for name in piece.piece.marks) for piece in pieces}
    return {title: count for title, count in counts.items() if count > 1}


def _zips(seam: SewnSeam) -> list[SeamOpening]:
    return [opening for opening in seam.openings if opening.kind == "zip"]


def _opened_steps(seam: SewnSeam, units: str) -> list[str]:
    """Return the steps of a seam with openings: its zip and what is closed beside it, then its slit or vent."""
    steps = []
    below = [opening.kind for opening in seam.openings if opening.kind in ("slit", "vent")]
    for opening in seam.openings:
        length = length_words(opening.length, units)
        if opening.kind == "zip":
            where = translate("from the upper edge down to the end of its line")
            if opening.begin > 0.0:
                where = translate(
                    "from {begin} below the upper edge down to the end of its line",
                    begin=length_words(opening.begin, units),
                )
            if opening.whole:
                where = translate("all along")
            words = translate(
                f"Sew the {opening.style} zip of {{length}} to both edges of {{seam}}, {{where}}".replace("  ", " "),
                length=length, seam=seam.words(), where=where,
            )  # fmt: skip
            if not opening.whole:
                words += translate(f", then close the seam below it{', down to the ' + below[0] if below else ''}")
        elif opening.kind == "buttons":
            words = translate("Close {seam} below the buttons", seam=seam.words())
        else:
            if not _zips(seam):
                steps.append(translate(f"Close {{seam}} down to the {opening.kind}.", seam=seam.words()))
            words = translate(
                "Fold the vent of {length} below {seam} to one side, and sew across its top"
                if opening.kind == "vent"
                else "Turn in the edges of the slit of {length} below {seam} and sew them down",
                length=length,
                seam=seam.letter,
            )
        steps.append(f"{words}.")
    return steps


def _mirror_groups(seams: Sequence[Seam], pieces: Mapping[str, Piece], rings: Mapping[str, int]) -> list[list[Seam]]:
    """Return seams that are each other's mirror images together, in the order in which they are sewn: those with openings first."""
    groups: dict[object, list[Seam]] = {}
    copied = {(s.piece, s.edge) for seam in seams for row in seam.sides for s in row if s.copy}
    alike: dict[tuple[str, str], object] = {}
    for seam in seams:
        # Edges of equal pieces, of which one is drawn, have the notches of one seam.
        own = [(s.piece, s.edge) for row in seam.sides for s in row if (s.piece, s.edge) in copied]
        if own:
            key = next((alike[edge] for edge in own if edge in alike), own[0])
            alike |= dict.fromkeys(own, key)
            groups.setdefault(key, []).append(seam)
            continue
        sides = sorted(
            tuple(sorted((without_side(s.piece), without_side(s.edge)) for s in side)) for side in seam.sides
        )
        # A zip in one side alone makes it another seam than the other side.
        groups.setdefault((without_side(seam.name), tuple(sides), seam.openings), []).append(seam)
    return sorted(
        groups.values(),
        key=lambda group: (_stage(group[0], pieces, rings), rings.get(group[0].name, -1), not group[0].openings),
    )


def _is_by_pieces(seam: Seam) -> bool:
    """Return whether a seam is called by the pieces that it joins; the last of such seams have numbers."""
    return re.sub(r" \d+$", "", seam.name) == joint_words(seam)


def is_flounce(piece: Piece) -> bool:
    """Return whether a piece is a panel of a flounce."""
    return "flounce" in re.split("[ _]", piece.name)


def _rings(pattern: Pattern) -> dict[str, int]:
    """Return the number of its ring for each seam that is part of one, where seams are called by the pieces that they join."""
    called = {seam.name for seam in pattern.seams if _is_by_pieces(seam)}
    pieces = {piece.name: piece for piece in pattern.pieces[pattern.sample]}
    rings = seam_rings(pattern.seams, pieces) if called else {}
    return {name: ring for name, ring in rings.items() if name in called}


def _stage(seam: Seam, pieces: Mapping[str, Piece], rings: Mapping[str, int]) -> int:
    """Return when a seam is sewn: by the roles of its pieces and, in the shell, by the words of its name, or with the panels.

    A seam that is called by its pieces is sewn with the panels, or around.
    """
    words = seam.name.lower().replace("_", " ").split(" ")
    roles = {pieces[side.piece].role for row in seam.sides for side in row}
    flounces = {is_flounce(pieces[side.piece]) for row in seam.sides for side in row if roles == {"shell"}}
    if True in flounces:
        return _ON_FLOUNCES if False in flounces else _FLOUNCES
    if "pocket" in roles:
        # What of a pocket lies in another seam is sewn with that; its own seams come first.
        roles = roles - {"pocket"} if words[0] != "pocket" else {"pocket"}
    if "facing" in words and "shoulder" in words:
        return len(_STAGES)
    for number, (_, known) in enumerate(_FINISHING):
        if roles in known:
            return len(_STAGES) + number
    if "facing" in words:
        return _ON_FACINGS
    if _is_by_pieces(seam):
        return _AROUND if seam.name in rings else 1
    for number, (_, keys) in reversed(list(enumerate(_STAGES))):
        if any(key in words for key in keys) and not (number == 4 and "shoulder" in words):
            return number
    return 1


def _letter(number: int) -> str:
    """Return A, B, ... Z, AA, AB, ..."""
    letters = ""
    number += 1
    while number:
        number, digit = divmod(number - 1, 26)
        letters = ascii_uppercase[digit] + letters
    return letters


def _words(side: Sequence[SeamSide], titles: Mapping[str, str]) -> str:
    return " + ".join(dict.fromkeys(titles[part.piece] for part in side))


def _dart_legs(piece: DraftedPiece, *, pleats: bool) -> dict[str, list[str]]:
    """Return the edges of a piece's darts, or of its pleats, by the names that are printed; a fisheye dart is its own line."""
    legs: dict[str, list[str]] = {}
    for dart in (each.dart for each in piece.darts):
        if (dart.pleat is not None) == pleats:
            legs.setdefault(translate_name(without_side(dart.name)), []).extend([dart.left, dart.right])
    for name in () if pleats else piece.fisheyes:
        legs.setdefault(translate_name(without_side(name)), []).append(name)
    return legs


def _free_edges(pieces: Sequence[DraftedPiece], seams: Sequence[Seam]) -> dict[str, list[Place]]:
    """Return the edges of kind "seam" that are in no seam, by their names without side and number."""
    sewn = {(part.piece, part.edge) for seam in seams for side in seam.sides for part in side}
    # A strip that is cut twice is drawn for one side.
    sewn |= {(of, other_side(edge)) for piece, edge in sewn for of in (piece, other_side(piece))}
    found: dict[str, list[Place]] = {}
    for piece in (piece for piece in pieces if piece.piece.role != "pocket"):
        for edge in piece.piece.edges:
            if edge.kind == "seam" and (piece.name, edge.name) not in sewn:
                found.setdefault(without_side(edge.name).rstrip(" 0123456789"), []).append((piece.name, edge.name))
    return found
