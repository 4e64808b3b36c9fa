"""Halves of a garment: the left one stands for both sides, so the right one must be its mirror image."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from warpflat.core import InputError, list_some

__all__ = ["check_halves", "fold_among", "is_side", "lies_on_both"]

#: Bricks, datum line and opened lines of a piece.
Cut = tuple[Sequence[str], str, Sequence[str]]

_CENTRES = ("centre front", "centre back")
_WHOLE = "cut it whole: half = false"
_LISTED = 4


def is_side(brick: str, side: str) -> bool:
    """Return whether a brick lies on a side of the body, ``left`` or ``right``."""
    return side in brick.partition("/")[2].split("-")


def lies_on_both(bricks: Iterable[str]) -> bool:
    """Return whether bricks lie on both sides of the body."""
    return {is_side(b, "left") for b in bricks} == {True, False}


def check_halves(pieces: Mapping[str, Cut]) -> None:
    """See that the left halves of pieces, mirrored, are their right halves.

    Args:
        pieces: by name.

    Raises:
        InputError: a piece on both sides is not its own mirror image, or no other piece is that of a piece on one side.
    """
    used = {b for bricks, _, _ in pieces.values() for b in bricks}
    for name, (bricks, datum, opened) in pieces.items():
        image = {_mirrored(b) for b in bricks}
        if lies_on_both(bricks):
            if image != set(bricks):
                lone = [b for b in bricks if b not in image]
                raise InputError(
                    f"form: half = true mirrors the left half, but in piece {name} {list_some(lone, _LISTED)} "
                    f"{'has' if len(lone) == 1 else 'have'} no mirror image; {_WHOLE}"
                )
            partner = name
        else:
            found = next((other for other, (theirs, _, _) in pieces.items() if set(theirs) == image), None)
            if found is None:
                lone = [b for b in bricks if _mirrored(b) not in used] or list(bricks)
                raise InputError(
                    f"form: half = true mirrors the left half, but no piece is the mirror image of piece {name} "
                    f"({list_some(lone, _LISTED)}); {_WHOLE}"
                )
            partner = found
        _, their_datum, theirs = pieces[partner]
        lines = [line for line in opened if _mirrored(line) not in theirs]
        if lines:
            raise InputError(
                f"form: half = true mirrors the left half, but piece {name} is open along {lines[0]!r} and piece {partner} not "
                f"along {_mirrored(lines[0])!r}; open both, or {_WHOLE}"
            )
        if partner != name and datum and their_datum and _mirrored(datum) != their_datum:
            raise InputError(
                f"form: half = true mirrors the left half, but piece {name} has its datum along {datum!r} and piece {partner} "
                f"along {their_datum!r}; make them mirror images, or {_WHOLE}"
            )


def fold_among(edges: Iterable[str], opened: Sequence[str], name: str) -> str:
    """Return the edge along which the left half of a piece lies on the fold.

    Args:
        edges: of the left half.
        opened: lines along which the piece is cut open.
        name: of the piece.

    Raises:
        InputError: the halves of the piece are joined along no edge, or along several.
    """
    found = sorted(edge for edge in edges if any(edge.startswith(line) for line in _CENTRES if line not in opened))
    if not found:
        raise InputError(
            f"form: piece {name} is not one disk: its halves are joined along no centre line; make each a piece of its own"
        )
    if len(found) > 1:
        raise InputError(
            f"form: piece {name} is not one disk: its halves are joined along {' and '.join(found)}; "
            f'choose neighbouring bricks, or open it along one, open = ["{found[0]}"]'
        )
    return found[0]


def _mirrored(name: str) -> str:
    """Return the name of a brick or line on the other side of the body; that of one on the midplane stays."""
    return re.sub(r"\b(left|right)\b", lambda side: "right" if side[0] == "left" else "left", name)
