"""Compare a scan's levels with tapes laid by trimesh and SciPy: `WARPFLAT_DATA=DIR python benchmarks/scan_tapes.py`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from warpflat.mannequin.mannequin import Mannequin
from warpflat.surface.io.read import read_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "mannequin"))
from body_tapes import leg_tape, tapes


def main() -> None:
    """Print height and girth by tape, and the package's differences in mm, without and with 2 mm of noise.

    Legs are taped at the package's heights: it has knee and calf at shares of the stature.
    """
    for name in ("female", "male", "male_heavy", "child"):
        vertices, faces = read_scan(Path(os.environ["WARPFLAT_DATA"]) / f"body_{name}.obj")
        for seed in (None, 0, 1, 2):
            points = np.asarray(vertices, float)
            if seed is not None:
                points = points + np.random.default_rng(seed).normal(0.0, 0.002, points.shape)
            levels = Mannequin.from_scan(points, faces, resolution_mm=20.0).levels()
            print(name, "as it is" if seed is None else f"noise {seed}")
            for level, (height, girth) in tapes(points, np.asarray(faces)).items():
                off = 1000.0 * np.array([levels[level].height - height, levels[level].girth - girth])
                print(f"  {level:10} {height:.3f} m {girth:.3f} m  height {off[0]:+6.1f} mm  girth {off[1]:+6.1f} mm")
            for level in ("thigh left", "knee left", "calf left", "ankle left", "thigh right", "calf right"):
                height = levels[level].height
                girth = leg_tape(points, np.asarray(faces), height, level.endswith("left"))
                off = 1000.0 * (levels[level].girth - girth)
                print(f"  {level:10} {height:.3f} m {girth:.3f} m  at the same height   girth {off:+6.1f} mm")


if __name__ == "__main__":
    main()
