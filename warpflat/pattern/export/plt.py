"""Patterns as HP-GL/2 for plotters and cutters, in true size: 40 units are one millimetre, and a pen stands for a kind of line.

Pen 1 is the cutting line, pen 2 notches and drill holes, pen 3 all other marks with the words. The cutting line comes last, so that a
piece still lies in its cloth while it is marked.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.drawing import draw_nest
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.drafting.words import printed_in
from warpflat.pattern.export.letters import plain_letters
from warpflat.pattern.files.output import atomic_path

__all__ = ["PENS", "UNITS_IN_METRE", "write_plt"]

UNITS_IN_METRE = 40_000.0
#: The pen of each role of a stroke; all others are marks.
PENS = {"cut": 1, "cutout": 1, "notch": 2, "drill": 2}
_MARKS = 3
# Width of the device's letters over their height: a letter takes 1.5 of its width, which is what those of other files take.
_WIDE = 0.55


def write_plt(garment: DraftedGarment, path: str | os.PathLike[str], *, sizes: Sequence[str] | None = None) -> None:
    """Write the pieces side by side; several sizes lie upon each other as a nest, without their sewing lines.

    Args:
        garment: drafted.
        path: of the file.
        sizes: those to draw; None draws all.

    Raises:
        InputError: an unknown size.
    """
    written: dict[int, list[str]] = {pen: [] for pen in (_MARKS, 2, 1)}
    for placed in lay_out(nests(garment.of_sizes(sizes))).placed:
        with printed_in(garment.pattern.words):
            drawings = draw_nest(placed.pieces)
        for drawing in drawings:
            for stroke in (stroke for stroke in drawing.strokes if not stroke.hidden):
                line = stroke.path if stroke.curve is None else stroke.curve.sample(0.5 / UNITS_IN_METRE)
                # Pen up to its first point, down along the others.
                units = np.rint(UNITS_IN_METRE * placed.on_sheet(line)).astype(np.int64)
                moved = np.concatenate([[True], (np.diff(units, axis=0) != 0).any(axis=1)])
                first, *others = [f"{x},{y}" for x, y in units[moved].tolist()]
                down = f"PD{','.join(others)};" if others else "PD;"
                written[PENS.get(stroke.role, _MARKS)].append(f"PU{first};{down}PU;")
            for words in drawing.words:
                # In the device's own letters, around its centre; those that ASCII lacks are written without their marks.
                x, y = np.rint(UNITS_IN_METRE * placed.on_sheet(words.at[None])[0]).astype(np.int64).tolist()
                letters = "".join(each if 32 <= ord(each) < 127 else "?" for each in plain_letters(words.text))
                high, turn = 100.0 * words.height, f"DI{np.cos(words.angle):.4f},{np.sin(words.angle):.4f};"
                # The character ETX ends a text.
                size = f"SI{_WIDE * high:.3f},{high:.3f};"
                written[_MARKS].append(f"PU{x},{y};LO5;{turn}{size}LB{letters}\x03;")
    rows = ["IN;"]
    for pen, lines in written.items():
        rows += [f"SP{pen};", *lines] if lines else []
    with atomic_path(path) as temporary:
        temporary.write_bytes("\n".join([*rows, "PU;SP0;", ""]).encode("ascii"))
