"""Draw docs/cutting.png, the paper's Fig. 6 for the bodice by formula: energy before and after cuts A and B.

python docs/cutting_figure.py
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import warpflat
from warpflat.flat.flattening.result import Flattening
from warpflat.pattern.export.picture import PicturePiece, write_picture
from warpflat.pattern.export.piece_files import picture_piece

RESOLUTION = 65


def row(result: Flattening, title: str, uncut: Flattening) -> PicturePiece:
    """Return one row of the figure, with its energies and their change against the uncut piece."""
    worn, before = result.stages[-1].strain_energy_j, uncut.stages[-1].strain_energy_j
    change = {
        "strain energy": (worn, before),
        "model energy": (result.stages[-1].model_energy_j, uncut.stages[-1].model_energy_j),
    }
    captions = {"fabric": result.fabric.name}
    for name, (now, then) in change.items():
        captions[name] = f"{1e3 * now:.0f} mJ" + (f" ({100 * (now / then - 1):.1f} %)" if result is not uncut else "")
    captions["length error"] = f"{100 * result.measures['length_error']:.2f} %"
    return replace(picture_piece(result), name=title, captions=captions)


def main(file: str) -> None:
    """Flatten the bodice, make both cuts and write the figure to `file`."""
    surface = warpflat.make_shape("bodice", resolution=RESOLUTION)
    grid = np.arange(RESOLUTION**2, dtype=np.int32).reshape(RESOLUTION, RESOLUTION)
    right = round((0.5 - 0.55 / np.pi) * (RESOLUTION - 1))
    left, level = RESOLUTION - 1 - right, round(0.28 / 0.45 * (RESOLUTION - 1))
    uncut = warpflat.flatten(surface, fabric="woven", datum="centre")
    bust = warpflat.CutPlan(name="bust", paths=(grid[level, : right + 1], grid[level, left:][::-1]))
    princess = warpflat.CutPlan(name="princess", paths=(grid[: level + 1, right], grid[: level + 1, left]))
    rows = [row(uncut, "uncut", uncut)]
    for title, plan in (("A: bust line, from both sides", bust), ("B: princess lines, from the hem", princess)):
        result = warpflat.cut(uncut, plan)
        rows.append(row(result, title, uncut))
        print(title, rows[-1].captions, f"flips {result.flipped_faces}")
    write_picture(file, rows)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(Path(__file__).with_name("cutting.png")))
