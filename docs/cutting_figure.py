"""Draws docs/cutting.png, the paper's Fig. 6 on the bodice by formula: energy before and after cuts A and B.

python docs/cutting_figure.py
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import warpflat
from warpflat import CutPlan, cut
from warpflat.export.picture import PicturePiece, write_picture
from warpflat.flattening.result import Flattening
from warpflat.surface.shapes import make_shape

RESOLUTION = 65


def row(result: Flattening, title: str, uncut: Flattening) -> PicturePiece:
    """A row of the figure."""
    worn, before = result.stages[-1].strain_energy_j, uncut.stages[-1].strain_energy_j
    change = {
        "energy": (result.stages[-1].model_energy_j, uncut.stages[-1].model_energy_j),
        "as worn": (worn, before),
    }
    captions = {"fabric": result.fabric.name}
    for name, (now, then) in change.items():
        captions[name] = f"{1e3 * now:.0f} mJ" + (f" ({100 * (now / then - 1):.1f} %)" if result is not uncut else "")
    captions["length error"] = f"{100 * result.measures['length_error']:.2f} %"
    return replace(result.picture_piece(), name=title, captions=captions)


def main(file: str) -> None:
    """Flatten, cut twice, draw."""
    surface = make_shape("bodice", resolution=RESOLUTION)
    grid = np.arange(RESOLUTION**2, dtype=np.int32).reshape(RESOLUTION, RESOLUTION)
    right = round((0.5 - 0.55 / np.pi) * (RESOLUTION - 1))
    left, level = RESOLUTION - 1 - right, round(0.28 / 0.45 * (RESOLUTION - 1))
    uncut = warpflat.flatten(surface, fabric="woven", datum="centre")
    bust = CutPlan(name="bust", paths=(grid[level, : right + 1], grid[level, left:][::-1]))
    princess = CutPlan(name="princess", paths=(grid[: level + 1, right], grid[: level + 1, left]))
    rows = [row(uncut, "uncut", uncut)]
    for title, plan in (("A: bust line, from both sides", bust), ("B: princess lines, from the hem", princess)):
        result = cut(uncut, plan)
        rows.append(row(result, title, uncut))
        print(title, rows[-1].captions, f"flips {result.flipped_faces}")
    write_picture(file, rows)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(Path(__file__).with_name("cutting.png")))
