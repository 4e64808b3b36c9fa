"""What must not change a drape: the mesh, noise of the start, friction and bending; one bodice, its surfaces compared.

    python benchmarks/drape_stability.py [--size "EU 38"] [--resolution 10] [--finer 5] [--fabric woven] [--darts]
        [--only mesh noise friction bending]

Distances are those of the vertices from the other worn surface, by area [mm]: mean, 95 %, most. Asked for: 0.3 mm mean between
meshes, 0.2 mm mean for the rest. Meshes are compared in three ways: one pattern, meshed twice, on one body; each its own pattern on one
body; and each its own pattern on its own body, where the bodies' own facets differ too.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp
from drape import dart_both_sides

import warpflat
from warpflat.core.sums import weighted_percentiles
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.drape_pattern import Placement, drape_pattern
from warpflat.garment.draping.lift import read_lift
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import sew_cloth


def bodice(size: str, resolution: float, fabric: str, *, darts: bool) -> warpflat.Garment:
    body = warpflat.Mannequin.from_size(size, resolution_mm=resolution)
    garment = warpflat.flatten_form(body, body.form("bodice"), fabric=fabric, sewn=not darts)
    if darts:
        garment = replace(garment, pieces={**garment.pieces, "front": dart_both_sides(garment.pieces["front"])})
    return garment


def show(name: str, of: warpflat.Drape, to: warpflat.Drape, limit: float) -> None:
    surface = Body(to.positions, to.cloth.faces, device=to.body.device)
    apart = np.abs(surface.gaps(of.positions))
    mean = float(apart @ of.areas / of.areas.sum())
    high = weighted_percentiles(apart, of.areas, [0.95])[0]
    rest = "" if of.converged and to.converged else "  NOT AT REST"
    verdict = "within" if 1e3 * mean <= limit else "ABOVE"
    print(
        f"{name:<24} {1e3 * mean:6.3f} {1e3 * high:6.2f} {1e3 * apart.max():6.1f}  {verdict} {limit} mm{rest}",
        flush=True,
    )


def remeshed(garment: warpflat.Garment, spacing: float) -> warpflat.Drape:
    """The garment's pattern meshed anew with some edge [mm], draped on the garment's body from its designed surface."""
    pattern, _ = pattern_of_garment({"": garment}, name="bodice")
    with tempfile.TemporaryDirectory() as folder:
        garment.save(folder, picture=False)
        lifts = {name: read_lift(Path(folder) / f"{name}.obj") for name in garment.pieces}
    fabric = next(iter(garment.pieces.values())).fabric
    placement = Placement(lifts=lifts, spacing=1e-3 * spacing)
    return drape_pattern(pattern, garment.mannequin, fabric=fabric, placement=placement)[0]


def compare_meshes(
    garment: warpflat.Garment, base: warpflat.Drape, fine: warpflat.Garment, given: argparse.Namespace
) -> None:
    names = f"{given.resolution:g} for {given.finer:g} mm"
    if not given.darts:
        meshes = [remeshed(garment, spacing) for spacing in (given.resolution, given.finer)]
        show(f"{names}, one pattern", *meshes, 0.3)
    finer = warpflat.drape(fine)
    show(f"{names}, one body", warpflat.drape(garment, fine.mannequin), finer, 0.3)
    show(f"{names}, own bodies", base, finer, 0.3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="EU 38")
    parser.add_argument("--resolution", type=float, default=10.0)
    parser.add_argument("--finer", type=float, default=5.0)
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--darts", action="store_true")
    parser.add_argument("--only", nargs="+", default=["noise", "friction", "bending", "mesh"])
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    garment = bodice(given.size, given.resolution, given.fabric, darts=given.darts)
    base = warpflat.drape(garment)
    print(
        f"{'bodice, ' + given.size:<24} {'mean':>6} {'95 %':>6} {'most':>6}  {len(base.positions):,} vertices, {base.worn.steps} steps"
    )
    if "noise" in given.only:
        cloth = sew_cloth(garment)
        noise = 2e-4 * np.random.default_rng(1).standard_normal(cloth.designed.shape)
        worn = relax_drape(cloth, base.body, held=np.zeros(len(noise), bool), start=cloth.designed + noise)
        show("noise of 0.2 mm", replace(base, worn=worn), base, 0.2)
    if "friction" in given.only:
        for friction in (0.2, 0.4):
            show(
                f"friction {friction} for 0.3",
                warpflat.drape(garment, options=warpflat.DrapeOptions(friction=friction)),
                base,
                0.2,
            )
    if "bending" in given.only:
        for times in (0.5, 2.0):
            pieces = {
                name: replace(piece, fabric=replace(piece.fabric, bending=times * piece.fabric.bending))
                for name, piece in garment.pieces.items()
            }
            show(f"bending {times:g} times", warpflat.drape(replace(garment, pieces=pieces)), base, 0.2)
    if "mesh" in given.only:
        compare_meshes(garment, base, bodice(given.size, given.finer, given.fabric, darts=given.darts), given)


if __name__ == "__main__":
    main()
