"""Pieces of a form are parted along whole feature lines, as by a princess seam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, nearest, other_side
from warpflat.flat import join_labels
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.darts import FormDart, place_darts
from warpflat.garment.mannequin.forms import Form, PieceRecipe
from warpflat.garment.mannequin.halves import is_side
from warpflat.garment.mannequin.layout import Layout

__all__ = ["part_labels", "part_pieces", "part_recipe", "princess_seams", "taken_over"]


def part_pieces(layout: Layout, vertices: FloatArray, form: Form, seams: Sequence[FormDart]) -> Form:
    """Part pieces along whole lines, and give their darts to the parts.

    Darts along a parting line go: the seam takes what they took in. So do those that have no place in a part, as the bust
    dart, whose point then lies on the border.

    Args:
        layout, vertices: of the body, #V by 3 [m].
        form: whose pieces are parted.
        seams: the cuts, each along a whole line.

    Raises:
        InputError: an unknown piece or line, or a line that does not part its piece.
    """
    lines: dict[str, list[str]] = {}
    for seam in seams:
        if seam.piece not in form.pieces:
            raise InputError(f"seam {seam.name!r}: no piece {seam.piece!r}; {nearest(seam.piece, form.pieces)}")
        if seam.line not in layout.lines:
            raise InputError(f"seam {seam.name!r}: line {seam.line!r} is unknown: {nearest(seam.line, layout.lines)}")
        images = (seam.line, other_side(seam.line)) if seam.mirrored else (seam.line,)
        lines.setdefault(seam.piece, []).extend(images)
    pieces: dict[str, PieceRecipe] = {}
    parts_of: dict[str, dict[str, PieceRecipe]] = {}
    for name, recipe in form.pieces.items():
        if name not in lines:
            pieces[name] = recipe
            continue
        chosen = select_bricks(layout, recipe.bricks)
        label = part_labels(layout, chosen, lines[name])
        if len(set(label.tolist())) == 1:
            raise InputError(
                f"{' and '.join(repr(line) for line in lines[name])} do not part piece {name!r}; name lines that cross it"
            )
        groups = [
            [brick for brick, of in zip(chosen, label, strict=True) if of == part] for part in dict.fromkeys(label)
        ]
        # Parts are named by where they lie to each other: centre and side_left, left and right, lower and upper.
        sides = [
            next((side for side in ("left", "right") if all(is_side(brick, side) for brick in part)), "")
            for part in groups
        ]
        columns = ["centre" if all(brick.endswith("-centre") for brick in part) else "side" for part in groups]
        if len(set(columns)) == 1 or not any(sides):
            columns = [("side" if side else "centre") if "" in sides and any(sides) else "" for side in sides]
        across = [
            column
            if column == "centre" and columns.count("centre") == 1
            else "_".join(word for word in (column, side) if word)
            for column, side in zip(columns, sides, strict=True)
        ]
        heights = [float(np.mean([vertices[layout.bricks[brick], 1].mean() for brick in part])) for part in groups]
        endings = []
        for number, word in enumerate(across):
            alike = sorted((k for k in range(len(across)) if across[k] == word), key=lambda k: heights[k])
            at = alike.index(number)
            place = "" if len(alike) == 1 else ("lower", "upper")[at] if len(alike) == 2 else f"{at + 1}"
            endings.append("_".join(part for part in (word, place) if part))
        # Those of the centre come first.
        ordered = sorted(zip(groups, endings, strict=True), key=lambda each: not each[1].startswith("centre"))
        parts_of[name] = {f"{name}_{end}": part_recipe(layout, recipe, part, lines[name]) for part, end in ordered}
        pieces |= parts_of[name]
    darts = []
    for dart in form.darts:
        if dart.piece not in lines:
            darts.append(dart)
        elif dart.line not in lines[dart.piece]:
            # It goes on in the first part of its piece in which it has a place; without one it goes.
            bricks = {name: select_bricks(layout, part.bricks) for name, part in parts_of[dart.piece].items()}
            for name in bricks:
                moved = replace(dart, piece=name)
                try:
                    place_darts(layout, vertices, bricks, [moved])
                except InputError:
                    continue
                darts.append(moved)
                break
    return replace(form, pieces=pieces, darts=tuple(darts))


def taken_over(layout: Layout, vertices: FloatArray, form: Form, seams: Sequence[FormDart]) -> list[FormDart]:
    """Return the darts of a form that go when its pieces are parted: along a seam, or with no place in a part.

    Args and errors as of :func:`part_pieces`.
    """
    gone = list[FormDart]()
    for piece in dict.fromkeys(seam.piece for seam in seams):
        # Of one piece at a time: a dart of another one may have its name and its line.
        own = tuple(dart for dart in form.darts if dart.piece == piece)
        parted = part_pieces(layout, vertices, replace(form, darts=own), seams)
        left = {(dart.name, dart.line, dart.at) for dart in parted.darts}
        gone += [dart for dart in own if (dart.name, dart.line, dart.at) not in left]
    return gone


def princess_seams(layout: Layout, bricks: Sequence[str], piece: str) -> list[FormDart]:
    """Return the cuts along whole princess lines that part a piece of these bricks, both sides of the body."""
    lines = [f"princess {face} left" for face in ("front", "back")]
    return [
        FormDart(name="princess seam", piece=piece, line=line, part=(0.0, 1.0))
        for line in lines
        if len(set(part_labels(layout, bricks, [line, other_side(line)]).tolist())) > 1
    ]


def part_recipe(layout: Layout, recipe: PieceRecipe, bricks: Sequence[str], lines: Sequence[str]) -> PieceRecipe:
    """Return the recipe of a part of a piece: with its datum if that runs there, else the first of the lines that part it there."""
    bounds, inside = layout.edges_of(bricks), layout.edges_of(bricks, inside=True)
    through = [line for line in (recipe.datum, *lines) if line and layout.edges_along(line) & bounds]
    opened = tuple(line for line in recipe.open if layout.edges_along(line) & inside)
    return PieceRecipe(bricks=tuple(bricks), datum=(through or [""])[0], open=opened)


def part_labels(layout: Layout, bricks: Sequence[str], lines: Sequence[str]) -> IntArray:
    """Return for each brick the number of the part to which it belongs: neighbours are one part unless a line lies between."""
    slits = layout.edges_along(*lines)
    edges = [layout.edges_of([brick]) - slits for brick in bricks]
    links = [(i, k) for i in range(len(bricks)) for k in range(i) if edges[i] & edges[k]]
    first, second = np.array(links, dtype=np.int32).reshape(-1, 2).T
    return join_labels(len(bricks), first, second)
