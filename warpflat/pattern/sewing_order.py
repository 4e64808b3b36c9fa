"""The order in which a garment is sewn, read off its darts, seams and free edges, with a letter for each seam."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import ascii_uppercase

from warpflat.core.text import other_side, without_side
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.measures import length_words
from warpflat.pattern.pieces import Piece, Seam, SeamOpening, SeamSide
from warpflat.pattern.words import translate, translate_name

__all__ = [
    "SewnSeam",
    "notions",
    "piece_titles",
    "seam_letters",
    "sewing_steps",
    "sewn_seams",
    "step_pictures",
    "tools",
]


#: Seams of the shell in the order in which they are closed, by words of their names; what has none of them comes with the panels.
_STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Make the pockets", ("pocket",)),
    ("Join the panels", ("princess", "panel", "yoke", "centre")),
    ("Sew the shoulders", ("shoulder",)),
    ("Sew the inner leg seams", ("inseam",)),
    ("Sew the side seams", ("side", "outseam")),
    ("Sew the sleeve seams", ("underarm", "overarm")),
    ("Sew the crotch seam", ("crotch",)),
    ("Join at the waist", ("waist", "hip", "abdomen", "underbust")),
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
    ("Sew bands and bindings to their edges", ({"strip", "shell"}, {"waistband", "shell"}, {"strip", "waistband"})),
    ("Sew the cuffs on, fold them right sides together, sew their ends and turn them", ({"cuff", "shell"}, {"cuff"})),
    ("Sew the hood's own seams", ({"hood"},)),
    ("Sew the hood on", ({"hood", "shell"},)),
    ("Make up the collar, right sides together, and turn it", ({"collar"},)),
    ("Sew the collar on", ({"collar", "shell"},)),
)
# A seam of these stages is mentioned by others.
_ON_FACINGS, _LININGS, _LAST = (len(_STAGES) + k for k in (1, 2, 5))


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
        stage: its place in `_STAGES` and `_FINISHING`.
        count: how often it is sewn.
        openings: where it can be opened, or is not closed.
    """

    letter: str
    name: str
    sides: tuple[str, str]
    length_mm: tuple[float, float]
    ease: float
    stretched: bool
    stage: int
    count: int
    openings: tuple[SeamOpening, ...]

    def words(self) -> str:
        """Return its letter, its name, its pieces, and how its longer or shorter side is held."""
        first, second = self.sides
        if first != second:
            words = translate("{seam}: {first} to {second}", seam=self.name, first=first, second=second)
        else:
            words = self.name if first in self.name else translate("{seam} of the {first}", seam=self.name, first=first)
        if abs(self.ease) >= 5e-4:
            longer, shorter = (second, first) if self.ease > 0 else (first, second)
            share = self.ease if self.ease > 0 else 1.0 / (1.0 + self.ease) - 1.0
            if self.stretched:
                words += translate(", stretch the {piece}", piece=shorter)
            else:
                words += translate(f", {'gather' if share > 0.15 else 'ease in'} the {{piece}}", piece=longer)
        return f"{self.letter} ({words})"


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
    groups = _mirror_groups(garment.garment.seams, pieces)
    found = []
    for number, group in enumerate(groups):
        seam = group[0]
        found.append(
            SewnSeam(
                letter=_letter(number),
                name=translate_name(without_side(seam.name) if len(group) > 1 else seam.name),
                sides=(_words(seam.sides[0], titles), _words(seam.sides[1], titles)),
                length_mm=lengths.get(seam.name, (0.0, 0.0)),
                ease=seam.ease,
                stretched=pieces[seam.sides[0 if seam.ease > 0 else 1][0].piece].role == "strip",
                stage=_stage(seam, pieces),
                count=len(group),
                openings=seam.openings,
            )
        )
    return tuple(found)


def seam_letters(garment: DraftedGarment) -> dict[str, str]:
    """Return the letter of each seam by its name."""
    size = next(iter(garment.pieces))
    pieces = {piece.name: piece.piece for piece in garment.pieces[size]}
    groups = _mirror_groups(garment.garment.seams, pieces)
    return {seam.name: _letter(number) for number, group in enumerate(groups) for seam in group}


def sewing_steps(garment: DraftedGarment, size: str) -> tuple[str, ...]:
    """Return the steps of making the garment, a sentence each."""
    pieces = garment.pieces[size]
    titles = piece_titles([piece.piece for piece in pieces])
    units, steps = garment.garment.units, list[str]()
    fused = [titles[piece.name] for piece in pieces if piece.piece.also or piece.piece.role == "interfacing"]
    if fused:
        steps.append(translate("Fuse the interfacing: {pieces}.", pieces=", ".join(fused)))
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
    welts = [titles[piece.name] for piece in pieces if "_pocket_welt" in piece.name]
    if welts:
        steps.append(
            translate(
                "Sew a folded welt and a bag to each marked place, cut between the seams, turn the bags in and close them: {pockets}.",
                pockets=", ".join(welts),
            )
        )
    pleated = [
        titles[piece.name] for piece in pieces if any("pleat fold" in name for name in piece.piece.internal_lines)
    ]
    if pleated:
        steps.append(
            translate(
                "Lay the pleats, each fold to the line beside it, press and baste them: {pieces}.",
                pieces=", ".join(pleated),
            )
        )
    buttoned = [piece for piece in pieces if "_placket" in piece.name and "button" in piece.piece.marks]
    if buttoned:
        steps.append(
            translate(
                "Sew a strip to each side of the marked box, cut the slit and into the corners, turn the strips in, fold them, lay the "
                "right one over the left and sew their lower ends down: {plackets}.",
                plackets=", ".join(titles[piece.name] for piece in buttoned),
            )
        )
    placket = [titles[piece.name] for piece in pieces if "_placket" in piece.name and piece not in buttoned]
    if placket:
        steps.append(
            translate(
                "Cut the slits where they are marked, and bind both their edges with one strip each: {plackets}.",
                plackets=", ".join(placket),
            )
        )
    seams = sewn_seams(garment, size)
    # Edges of linings and facings that no seam takes: they end at a zip, are caught in a binding, or are finished by themselves.
    free = _free_edges(pieces, garment.garment.seams, titles, ("seam",))
    shell = {piece.name: piece.piece for piece in pieces if piece.piece.role == "shell"}
    zipped = {
        side.edge
        for seam in garment.garment.seams
        for row in seam.sides
        for side in row
        if any(each.kind == "zip" for each in seam.openings)
    }
    bound = {
        without_side(side.edge)
        for seam in garment.garment.seams
        if _stage(seam, {piece.name: piece.piece for piece in pieces}) == _LAST
        for row in seam.sides
        for side in row
        if side.piece in shell
    }
    inside = {titles[piece.name] for piece in pieces if piece.piece.role in ("lining", "facing")}
    at_zip = [
        title for edge, rows in free.items() if edge in map(without_side, zipped) for title in rows if title in inside
    ]
    basted = {edge: [t for t in rows if t in inside] for edge, rows in free.items() if edge in bound}
    for stage in sorted({seam.stage for seam in seams}):
        what = translate([*_STAGES, *_FINISHING][stage][0])
        here = [seam for seam in seams if seam.stage == stage]
        if stage == _LAST and any(basted.values()):
            steps.append(
                translate(
                    "Baste the lining to the shell, wrong sides together: {edges}.",
                    edges=", ".join(translate_name(edge) for edge, rows in basted.items() if rows),
                )
            )
        plain = [seam for seam in here if not seam.openings or stage == _LININGS]
        for seam in (seam for seam in here if seam not in plain):
            steps += _opened_steps(seam, units)
        if plain:
            words = [seam.words() + (translate(", open beside the zip") if _zips(seam) else "") for seam in plain]
            steps.append(translate("{what}, notch to notch: {seams}.", what=what, seams=", ".join(words)))
        if stage == _LININGS:
            at_zip += [side for seam in here if _zips(seam) for side in seam.sides]
        if (
            stage in (_LININGS + 1, _ON_FACINGS)
            and at_zip
            and stage == max(each.stage for each in seams if each.stage in (_LININGS + 1, _ON_FACINGS))
        ):
            steps.append(
                translate(
                    "At the zip, turn in the edges and sew them to its tape by hand: {pieces}.",
                    pieces=", ".join(dict.fromkeys(at_zip)),
                )
            )
    left = {
        edge: [title for title in rows if not (title in at_zip or title in basted.get(edge, ()))]
        for edge, rows in free.items()
    }
    if any(left.values()):
        words = [f"{translate_name(edge)} ({', '.join(rows)})" for edge, rows in left.items() if rows]
        steps.append(
            translate("Finish the raw edges with a facing, a band or binding: {edges}.", edges="; ".join(words))
        )
    # Slits and vents are hems of their own, which the steps of their seams have turned in.
    hems: dict[float, list[str]] = {}
    opened, cased = {"slit", "vent"}, {elastic.edge for elastic in garment.garment.elastics}
    for piece in (piece for piece in pieces if piece.piece.role != "pocket"):
        for edge in piece.edges:
            called = without_side(edge.name).rstrip(" 0123456789")
            if edge.kind == "hem" and called not in cased and not opened & set(edge.name.split(" ")):
                hems.setdefault(round(edge.width, 4), []).append(titles[piece.name])
    if hems:
        words = [f"{length_words(width, units)} ({', '.join(dict.fromkeys(rows))})" for width, rows in hems.items()]
        steps.append(translate("Turn up and sew the hems: {edges}.", edges=", ".join(words)))
    for elastic in garment.garment.elastics:
        # Without a strip of its own the edge is turned in.
        turned_in = any(
            edge.kind == "hem" and without_side(edge.name).rstrip(" 0123456789") == elastic.edge
            for piece in pieces
            for edge in piece.edges
        )
        phrase = "Turn in the {edge} as a casing of {width}" if turned_in else "Fold the band of the {edge} to {width}"
        steps.append(
            translate(
                f"{phrase}, leave a gap in its seam, thread elastic of {{length}} through it, and close both.",
                edge=translate_name(elastic.edge),
                width=length_words(elastic.width, units),
                length=length_words(elastic.lengths[size], units),
            )
        )
    for title, count in _buttons(pieces).items():
        steps.append(
            translate(
                "Work the buttonholes on the right half, and sew {count} buttons to the left one: {title}.",
                count=count,
                title=title,
            )
        )
    ends = [titles[piece.name] for piece in pieces if _buttons_at_one_end(piece)]
    if ends:
        steps.append(
            translate("Work a buttonhole at one end, and sew a button to the other: {pieces}.", pieces=", ".join(ends))
        )
    return tuple(steps)


def notions(garment: DraftedGarment, size: str) -> tuple[str, ...]:
    """Return what is needed beside the cloth: thread, zips, elastics and buttons."""
    units = garment.garment.units
    zips = [
        translate(
            f"{{count}} {opening.style} zip of {{length}}", count=seam.count, length=length_words(opening.length, units)
        )
        for seam in sewn_seams(garment, size)
        for opening in _zips(seam)
        if seam.stage < len(_STAGES)
    ]
    elastics = [
        translate(
            "{count} elastic of {length}, at most {width} wide",
            count=elastic.count,
            length=length_words(elastic.lengths[size], units),
            width=length_words(elastic.width, units),
        )
        for elastic in garment.garment.elastics
    ]
    buttons = _buttons(garment.pieces[size]).values()
    # Both layers of a collar have one button.
    small = sum(
        piece.piece.quantity // (2 if piece.piece.role == "collar" else 1)
        for piece in garment.pieces[size]
        if _buttons_at_one_end(piece)
    )
    return (
        translate("sewing thread"),
        *zips,
        *elastics,
        *(translate("{count} buttons", count=count) for count in buttons),
        *([translate("{count} small buttons", count=small)] if small else []),
    )


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
    return ", ".join(translate(word) for word in needed)


def step_pictures(garment: DraftedGarment, size: str, steps: Sequence[str]) -> list[dict[str, frozenset[str]]]:
    """Return for each step its pieces, and of each the edges that are sewn.

    A step names its seams by their letters, and its pieces by their titles.
    """
    pieces = {piece.name: piece for piece in garment.pieces[size]}
    titles = piece_titles([piece.piece for piece in pieces.values()])
    letters = seam_letters(garment)
    darts = translate("Sew the darts, from the edge to the tip, and press them: {darts}.", darts="\n").split("\n")[0]
    hems = translate("Turn up and sew the hems: {edges}.", edges="\n").split("\n")[0]
    found = []
    for step in steps:
        named = set(re.findall(r"(?<!\w)([A-Z]{1,2})(?= \()", step)) | set(
            re.findall(r"(?<= )([A-Z]{1,2})(?= [a-z])", step)
        )
        sewn: dict[str, set[str]] = {}
        for seam in garment.garment.seams:
            if letters[seam.name] in named:
                for side in (side for row in seam.sides for side in row):
                    sewn.setdefault(side.piece, set()).add(side.edge)
        if not sewn:
            rest = step
            for name, title in sorted(titles.items(), key=lambda each: -len(each[1])):
                if re.search(rf"(?<!\w){re.escape(title)}(?!\w)", rest):
                    rest = re.sub(rf"(?<!\w){re.escape(title)}(?!\w)", "", rest)
                    kind = "dart" if step.startswith(darts) else "hem" if step.startswith(hems) else ""
                    sewn[name] = {edge.name for edge in pieces[name].edges if edge.kind == kind}
                    sewn[name] |= set(pieces[name].fisheyes) if kind == "dart" else set()
        found.append({name: frozenset(edges) for name, edges in sewn.items()})
    return found


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
            where = translate("from the upper edge down to its notch")
            if opening.begin > 0.0:
                where = translate(
                    "from {begin} below the upper edge down to its notch", begin=length_words(opening.begin, units)
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


def _mirror_groups(seams: Sequence[Seam], pieces: Mapping[str, Piece]) -> list[list[Seam]]:
    """Return seams that are each other's mirror images together, in the order in which they are sewn: those with openings first."""
    groups: dict[object, list[Seam]] = {}
    for seam in seams:
        sides = sorted(
            tuple(sorted((without_side(s.piece), without_side(s.edge)) for s in side)) for side in seam.sides
        )
        # A zip in one side alone makes it another seam than the other side.
        groups.setdefault((without_side(seam.name), tuple(sides), seam.openings), []).append(seam)
    return sorted(groups.values(), key=lambda group: (_stage(group[0], pieces), not group[0].openings))


def _stage(seam: Seam, pieces: Mapping[str, Piece]) -> int:
    """Return when a seam is sewn: by the roles of its pieces and, in the shell, by the words of its name, or with the panels."""
    words = seam.name.lower().replace("_", " ").split(" ")
    roles = {pieces[side.piece].role for row in seam.sides for side in row}
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


def _dart_names(piece: DraftedPiece, *, pleats: bool = False) -> list[str]:
    names = [without_side(dart.dart.name) for dart in piece.darts if (dart.dart.pleat is not None) == pleats]
    names += [without_side(name) for name in ([] if pleats else piece.fisheyes)]
    return [translate_name(name) for name in dict.fromkeys(names)]


def _free_edges(
    pieces: Sequence[DraftedPiece], seams: Sequence[Seam], titles: Mapping[str, str], kinds: Sequence[str]
) -> dict[str, list[str]]:
    """Return the pieces of the edges of some kinds that are in no seam, by the edges' names without side and number."""
    sewn = {(part.piece, part.edge) for seam in seams for side in seam.sides for part in side}
    # A strip that is cut twice is drawn for one side.
    sewn |= {(of, other_side(edge)) for piece, edge in sewn for of in (piece, other_side(piece))}
    found: dict[str, list[str]] = {}
    for piece in (piece for piece in pieces if piece.piece.role != "pocket"):
        for edge in piece.piece.edges:
            if edge.kind in kinds and (piece.name, edge.name) not in sewn:
                of_edge = found.setdefault(without_side(edge.name).rstrip(" 0123456789"), [])
                of_edge += [] if titles[piece.name] in of_edge else [titles[piece.name]]
    return found


def _listed(names: Sequence[str]) -> str:
    both = f" {translate('and')} "
    return both.join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
