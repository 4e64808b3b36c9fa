"""The order in which a garment is sewn, read off its darts, seams and free edges, with a letter for each seam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import ascii_uppercase

from warpflat.core.text import other_side, without_side
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.pieces import Piece, Seam, SeamSide
from warpflat.pattern.words import translate, translate_name

__all__ = ["SewnSeam", "piece_titles", "seam_letters", "sewing_steps", "sewn_seams"]


#: Seams in the order in which they are closed, by words of their names; what has none of them comes with the panels.
_STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Join the panels", ("princess", "panel", "yoke", "centre")),
    ("Sew the shoulders", ("shoulder",)),
    ("Sew the inner leg seams", ("inseam",)),
    ("Sew the side seams", ("side", "outseam")),
    ("Sew the sleeve seams", ("underarm", "overarm")),
    ("Sew the crotch seam", ("crotch",)),
    ("Join at the waist", ("waist", "hip", "abdomen", "underbust")),
    ("Set the sleeves in", ("armhole",)),
    ("Attach the collar", ("neck", "collar")),
    ("Join the linings", ("lining",)),
    ("Join facings, bands and bindings, and sew them to their edges", ("facing", "band", "binding", "waistband")),
)


@dataclass(frozen=True, kw_only=True)
class SewnSeam:
    """A seam as the maker meets it; its mirror image, which is sewn alike, is the same one.

    Attributes:
        letter: written beside its notches.
        name: without left and right, if both are sewn.
        sides: the pieces of both sides, in words.
        length_mm: of both sides.
        ease: by how much the second side is eased or gathered in, as a share.
        stage: its place in `_STAGES`.
        count: how often it is sewn.
    """

    letter: str
    name: str
    sides: tuple[str, str]
    length_mm: tuple[float, float]
    ease: float
    stage: int
    count: int


def piece_titles(pieces: Sequence[Piece]) -> dict[str, str]:
    """Return what each piece is called: one that is cut in pairs has no side."""
    titles = {
        piece.name: translate_name(without_side(piece.name))
        if piece.paired and piece.quantity % 2 == 0 and not piece.on_fold and not piece.title
        else piece.printed_name
        for piece in pieces
    }
    plain = list(titles.values())
    names = {piece.name: piece.printed_name for piece in pieces}
    return {name: title if plain.count(title) == 1 else names[name] for name, title in titles.items()}


def sewn_seams(garment: DraftedGarment, size: str) -> tuple[SewnSeam, ...]:
    """Return the seams of a garment in their order, each with its letter."""
    pieces = {piece.name: piece.piece for piece in garment.pieces[size]}
    titles = piece_titles(list(pieces.values()))
    lengths = {report.name: report.length_mm for report in garment.seams if report.size == size}
    groups = _mirror_groups(garment.garment.seams)
    ordered = sorted(groups, key=lambda group: _stage(group[0], pieces))
    found = []
    for number, group in enumerate(ordered):
        seam = group[0]
        found.append(
            SewnSeam(
                letter=_letter(number),
                name=translate_name(without_side(seam.name) if len(group) > 1 else seam.name),
                sides=(_words(seam.sides[0], titles), _words(seam.sides[1], titles)),
                length_mm=lengths.get(seam.name, (0.0, 0.0)),
                ease=seam.ease,
                stage=_stage(seam, pieces),
                count=len(group),
            )
        )
    return tuple(found)


def seam_letters(garment: DraftedGarment) -> dict[str, str]:
    """Return the letter of each seam by its name."""
    size = next(iter(garment.pieces))
    pieces = {piece.name: piece.piece for piece in garment.pieces[size]}
    ordered = sorted(_mirror_groups(garment.garment.seams), key=lambda group: _stage(group[0], pieces))
    return {seam.name: _letter(number) for number, group in enumerate(ordered) for seam in group}


def sewing_steps(garment: DraftedGarment, size: str) -> tuple[str, ...]:
    """Return the steps of making the garment, a sentence each."""
    pieces = garment.pieces[size]
    titles = piece_titles([piece.piece for piece in pieces])
    steps = []
    pleats = [
        f"{titles[piece.name]}: {_listed(names)}" for piece in pieces if (names := _dart_names(piece, pleats=True))
    ]
    darts = [f"{titles[piece.name]}: {_listed(names)}" for piece in pieces if (names := _dart_names(piece))]
    if darts:
        steps.append(
            translate("Sew the darts, from the edge to the tip, and press them: {darts}.", darts="; ".join(darts))
        )
    if pleats:
        steps.append(
            translate(
                "Fold the pleats and sew them as far as they are marked; they hang open below: {pleats}.",
                pleats="; ".join(pleats),
            )
        )
    patches = [
        titles[piece.name]
        for piece in pieces
        if piece.piece.role == "pocket" and any(edge.kind == "hem" for edge in piece.edges)
    ]
    if patches:
        steps.append(
            translate("Turn in the patch pockets and sew them to their marks: {pockets}.", pockets=", ".join(patches))
        )
    seams = sewn_seams(garment, size)
    for stage in sorted({seam.stage for seam in seams}):
        what = translate(_STAGES[stage][0] if stage < len(_STAGES) else "Sew")
        parts = []
        for seam in (seam for seam in seams if seam.stage == stage):
            first, second = seam.sides
            words = translate("{seam}: {first} to {second}", seam=seam.name, first=first, second=second)
            if first == second:
                words = translate("{seam} of the {first}", seam=seam.name, first=first)
            if abs(seam.ease) >= 5e-4:
                longer, share = (second, seam.ease) if seam.ease > 0 else (first, 1.0 / (1.0 + seam.ease) - 1.0)
                words += translate(f", {'gather' if share > 0.15 else 'ease in'} the {{piece}}", piece=longer)
            parts.append(f"{seam.letter} ({words})")
        steps.append(translate("{what}, notch to notch: {seams}.", what=what, seams=", ".join(parts)))
    free = _free_edges(pieces, garment.garment.seams, titles, ("seam",))
    if free:
        steps.append(translate("Finish the raw edges with a facing, a band or binding: {edges}.", edges=free))
    hems = _free_edges(pieces, garment.garment.seams, titles, ("hem",))
    if hems:
        steps.append(translate("Turn up and sew the hems: {edges}.", edges=hems))
    buttons = {titles[piece.name]: sum(name.startswith("button") for name in piece.piece.marks) for piece in pieces}
    return (
        *steps,
        *[
            translate(
                "Work the buttonholes on the right half, and sew {count} buttons to the left one: {title}.",
                count=count,
                title=title,
            )
            for title, count in buttons.items()
            if count > 1
        ],
    )


def _mirror_groups(seams: Sequence[Seam]) -> list[list[Seam]]:
    """Return seams that are each other's mirror images together."""
    groups: dict[object, list[Seam]] = {}
    for seam in seams:
        sides = sorted(
            tuple(sorted((without_side(s.piece), without_side(s.edge)) for s in side)) for side in seam.sides
        )
        groups.setdefault((without_side(seam.name), tuple(sides)), []).append(seam)
    return list(groups.values())


def _stage(seam: Seam, pieces: Mapping[str, Piece]) -> int:
    """Return when a seam is sewn: by the words of its name, or with the panels."""
    words = seam.name.lower().replace("_", " ").split(" ")
    for number, (_, keys) in reversed(list(enumerate(_STAGES))):
        if any(key in words for key in keys) and not (number == 3 and "shoulder" in words):
            return number
    return 0


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


def _dart_names(piece: DraftedPiece, *, pleats: bool = False) -> list[str]:
    names = [without_side(dart.dart.name) for dart in piece.darts if (dart.dart.pleat is not None) == pleats]
    names += [without_side(name) for name in ([] if pleats else piece.fisheyes)]
    return [translate_name(name) for name in dict.fromkeys(names)]


def _free_edges(
    pieces: Sequence[DraftedPiece], seams: Sequence[Seam], titles: Mapping[str, str], kinds: Sequence[str]
) -> str:
    """Return the edges of some kinds that are in no seam, by name, with their pieces."""
    sewn = {(part.piece, part.edge) for seam in seams for side in seam.sides for part in side}
    # A strip that is cut twice is drawn for one side.
    sewn |= {(piece, other_side(edge)) for piece, edge in sewn}
    found: dict[str, list[str]] = {}
    for piece in (piece for piece in pieces if piece.piece.role != "pocket"):
        for edge in piece.piece.edges:
            if edge.kind in kinds and (piece.name, edge.name) not in sewn:
                of_edge = found.setdefault(translate_name(without_side(edge.name)), [])
                of_edge += [] if titles[piece.name] in of_edge else [titles[piece.name]]
    return "; ".join(f"{name} ({', '.join(of_edge)})" for name, of_edge in found.items())


def _listed(names: Sequence[str]) -> str:
    both = f" {translate('and')} "
    return both.join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
