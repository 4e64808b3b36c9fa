"""The bodice of several sizes with and without bust darts: gap at the armhole, misfit, and misfit after the pattern's correction.

    python benchmarks/drape_bodice.py [--sizes "EU 36" "EU 38" "EU 40" "EU 42" "EU 44"] [--rounds 3] [--resolution 10]

Millimetres but for strain (share of the area beyond the cloth's limit, percent) and processor seconds.
"""

from __future__ import annotations

import argparse
import time

import warp as wp
from drape import worn

import warpflat


def armhole_gap(drape: warpflat.Drape) -> float:
    """The largest gap along the front's armholes [mm]."""
    return 1e3 * max(gap for line, gap in drape.measures()["gap_m"].items() if line.startswith("front.armhole"))


def row(name: str, size: str, resolution: float, rounds: int) -> str:
    began = time.process_time()
    drape, _ = worn(name, size, resolution, "woven")
    draped = time.process_time() - began
    found = warpflat.correct_pattern(drape, rounds=rounds)
    cells = [f"{name:13} {size}"]
    for each, of_round in ((found.before, found.rounds[0]), (found.after, found.rounds[-1])):
        largest = 1e3 * each.measures()["misfit_m"]["max"]
        cells.append(
            f"{armhole_gap(each):5.1f} {1e3 * of_round.misfit:6.3f} {1e3 * of_round.misfit_p95:6.3f} {largest:6.2f} "
            f"{100 * of_round.strained:5.2f} {'' if each.converged else 'NOT AT REST'}"
        )
    moved = 1e3 * max(abs(values).max() for values in found.moved().values())
    share = found.rounds[-1].misfit / found.rounds[0].misfit
    seconds = time.process_time() - began
    cells.append(f"{share:5.2f} {moved:6.1f} {1e3 * found.seam_difference():8.4f} {draped:6.1f} {seconds:6.1f}")
    return " | ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--garments", nargs="+", default=["bodice", "bodice+darts"])
    parser.add_argument("--sizes", nargs="+", default=["EU 36", "EU 38", "EU 40", "EU 42", "EU 44"])
    parser.add_argument("--resolution", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    half = "  gap   mean    p95    max  beyond"
    print(f"{'':19} |{half} |{half} corrected | share  moved  seams  draped s  all s")
    for name in given.garments:
        for size in given.sizes:
            print(row(name, size, given.resolution, given.rounds), flush=True)


if __name__ == "__main__":
    main()
