"""Seams in words: as sewers call them, and at the edges that they join, for files that know edges alone (DXF and SVG)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from warpflat.core import InputError
from warpflat.pattern.drafting.names import unnumbered
from warpflat.pattern.drafting.pieces import Place, Seam, SeamSide

__all__ = ["joint_words", "seam_words", "seams_of_words"]

# What is written at an edge; a seam's name may have anything in it.
_WORDS = re.compile(r"\A(.+) \| side ([12]) part (\d+) \| ([^|]+?)(?: \| ease (\S+ \S+ \S+))?\Z")


def joint_words(seam: Seam) -> str:
    """Return what sewers call a seam: "crown to side front", by the pieces of both sides, without their numbers."""
    first, second = (
        " + ".join(dict.fromkeys(unnumbered(side.piece.replace("_", " ")) for side in row)) for row in seam.sides
    )
    return f"{first} to {second}" if first != second else f"seam of the {first}"


def seam_words(seams: Iterable[Seam]) -> dict[Place, list[str]]:
    """Return what is written at each edge, by piece and edge: "NAME | side 1 part 1 | against mirrored | ease 0.03 0 1".

    The third part says how the seam runs along the edge, whether the edge is one of a copy that is cut turned over, and which copy.
    """
    found: dict[Place, list[str]] = {}
    for seam in seams:
        for number, chain in enumerate(seam.sides, start=1):
            for part, side in enumerate(chain, start=1):
                how = ("against" if side.reversed else "with") + (" mirrored" if side.mirrored else "")
                how += f" copy {side.copy + 1}" if side.copy else ""
                words = f"{seam.name} | side {number} part {part} | {how}"
                if seam.ease:
                    words += f" | ease {seam.ease:.6g} {seam.eased[0]:.6g} {seam.eased[1]:.6g}"
                found.setdefault(side.place, []).append(words)
    return found


def seams_of_words(found: Iterable[tuple[str, str, str]]) -> list[Seam]:
    """Return the seams that are written at edges: piece, edge, words of each.

    Raises:
        InputError: words of another form, or a seam of which one side is missing.
    """
    sides: dict[str, tuple[dict[int, SeamSide], dict[int, SeamSide]]] = {}
    eases: dict[str, Sequence[float]] = {}
    for piece, edge, words in found:
        try:
            [(name, number, part, how, ease)] = _WORDS.findall(words)
            chain = sides.setdefault(name, ({}, {}))[int(number) - 1]
            side = SeamSide(
                piece=piece, edge=edge, reversed="against" in how, mirrored="mirrored" in how,
                copy=int(how.partition("copy ")[2] or 1) - 1,
            )  # fmt: skip
            chain[int(part)] = side
            if ease:
                eases[name] = [float(value) for value in ease.split(" ")]
        except ValueError:
            raise InputError(f"seam {words!r} at {piece}.{edge}: must read 'NAME | side 1 part 1 | with'") from None
    seams = []
    for name, (first, second) in sides.items():
        if not (first and second):
            only = next(iter((first or second).values()))
            raise InputError(f"seam {name!r} has one side, {only}; its other edge is missing in the file")
        ease, low, high = eases.get(name, (0.0, 0.0, 1.0))
        chains = tuple(first[k] for k in sorted(first)), tuple(second[k] for k in sorted(second))
        seams.append(Seam(name=name, sides=chains, ease=ease, eased=(low, high)))
    return seams
