"""The paper's case (its Fig. 6) on front bodices of the mannequin: what the bust line and the princess lines release.

    python benchmarks/paper_cuts.py ["EU 36" "EU 38" ...]

For each size: the energy that is minimised and, in brackets, the strain energy as worn, of the uncut piece and with

    A  the bust line, from each side to the crossing with the princess lines, near the bust points
    B  the princess lines, from the waist up to the bust line

in the fabric `woven`. The paper, on its own mannequin: 1.66 J, A 1.32 J (-20.5 %), B 1.16 J (-30.1 %).

    python benchmarks/paper_cuts.py --lengths [--fabric woven] [SIZE]

The paper gives neither its cloth nor the lengths of its cuts. This tells at which lengths its shares come out, as cuts grow from
the border towards the bust point, and at which stiffness its joules: all energies are proportional to it.
"""

from __future__ import annotations

import argparse

import numpy as np

import warpflat
from warpflat.core.polyline import polyline_length
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.flattening.result import Flattening
from warpflat.garment.mannequin.mannequin import Mannequin

#: The paper's strain energies [J].
PAPER = {"uncut": 1.66, "A": 1.32, "B": 1.16}


def paths(piece: Flattening, line: str, stops: list[str]) -> tuple[np.ndarray, ...]:
    """The parts of a line from each of its border ends to the vertex it shares with a stop line."""
    along = piece.surface.lines[line]
    found = []
    for stop in stops:
        at = int(np.flatnonzero(np.isin(along, piece.surface.lines[stop]))[0])
        found.append(along[: at + 1] if at < len(along) / 2 else along[at:][::-1])
    return tuple(found)


def lengths(size: str, fabric: str) -> None:
    """Print what cuts of growing length release, and where the paper's figures lie among them."""
    block = Mannequin.from_size(size).form("basic_block").pieces["front_bodice"]
    whole = warpflat.flatten(block.surface, fabric=fabric, datum=block.datum)
    uncut = energies(whole)[1]
    thread = max(whole.fabric.stiffness_warp, whole.fabric.stiffness_weft)
    factor = PAPER["uncut"] / uncut
    print(f"{size}, {fabric}: strain energy {1e3 * uncut:.0f} mJ uncut; {PAPER['uncut']} J at {factor:.1f} times its "
          f"stiffness, {factor * thread:,.0f} N/m along the threads")  # fmt: skip
    sides = ["princess front left", "princess front right"]
    cuts = {
        "A": paths(whole, "bust", sides),
        "B": tuple(path for side in sides for path in paths(whole, side, ["bust"])),
    }
    for name, full in cuts.items():
        found = [(0.0, 0.0)]
        reach = polyline_length(whole.surface.vertices[full[0]])
        for share in (0.125, 0.25, 0.375, 0.5, 0.75, 1.0):
            rows = tuple(path[: max(2, round(share * (len(path) - 1)) + 1)] for path in full)
            after = energies(cut(whole, CutPlan(name=name, paths=rows)))[1]
            found.append((polyline_length(whole.surface.vertices[rows[0]]), 1.0 - after / uncut))
        wanted = 1.0 - PAPER[name] / PAPER["uncut"]
        at = float(np.interp(wanted, [share for _, share in found], [length for length, _ in found]))
        row = ", ".join(f"{1e3 * length:.0f} mm {-100 * share:.1f} %" for length, share in found[1:])
        print(
            f"  {name}: {row}; the paper's {-100 * wanted:.1f} % at {1e3 * at:.0f} of {1e3 * reach:.0f} mm", flush=True
        )


def energies(piece: Flattening) -> tuple[float, float]:
    """Minimised energy and strain energy as worn [J]."""
    last = piece.stages[-1]
    return last.model_energy_j, last.strain_energy_j


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sizes", nargs="*", metavar="SIZE", help="[default: EU 36 to EU 44]")
    parser.add_argument("--lengths", action="store_true", help="cuts of growing length")
    parser.add_argument("--fabric", default="woven", help="of --lengths [default: woven]")
    arguments = parser.parse_args()
    if arguments.lengths:
        for size in arguments.sizes or ["EU 38"]:
            lengths(size, arguments.fabric)
        return
    sizes = arguments.sizes or ["EU 36", "EU 38", "EU 40", "EU 42", "EU 44"]
    print(f"{'size':8}{'uncut':>20}{'A: bust line':>34}{'B: princess lines':>34}")
    for size in sizes:
        block = Mannequin.from_size(size).form("basic_block").pieces["front_bodice"]
        whole = warpflat.flatten(block.surface, fabric="woven", datum=block.datum)
        sides = ["princess front left", "princess front right"]
        plans = [CutPlan(name="A", paths=paths(whole, "bust", sides))]
        up = tuple(path for line in sides for path in paths(whole, line, ["bust"]))
        plans.append(CutPlan(name="B", paths=up))
        before = energies(whole)
        row = f"{size:8}{1e3 * before[0]:10.1f} ({1e3 * before[1]:.1f}) mJ"
        for plan in plans:
            result = cut(whole, plan)
            after = energies(result)
            change = [100 * (a / b - 1) for a, b in zip(after, before, strict=True)]
            flag = "" if result.converged and not result.flipped_faces else " !"
            row += f"{1e3 * after[0]:14.1f} mJ {change[0]:+.1f} % ({change[1]:+.1f} %){flag}"
        print(row, flush=True)


if __name__ == "__main__":
    main()
