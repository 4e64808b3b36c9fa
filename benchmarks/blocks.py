"""Compare the darted basic block with a drafted one, size by size.

    python benchmarks/blocks.py [--sizes "EU 36" "EU 38" ...]

The scene is `scenes/basic_block.toml`, as it ships. The drafted block was made by another program, FreeSewing's public
designs `bella` (bodice) and `penelope` (skirt), for EU 38 (bust 880, waist 720, hip 960 mm) with low ease and with ease as
the designs have it. All values are of half a piece [mm; areas in cm2], a range where these two differ.

    python benchmarks/blocks.py --men

compares the bodice of three men's sizes, without darts and with 5 cm of ease at the chest, with FreeSewing's `brian` 4.10.2 (MIT
licence), drafted for the lengths and girths of the package's own form and the same ease, its other options as they are. That is
a boxy block: its side is straight down, and no waist is fitted. Its neck point lies farther from the centre, so its shoulder is
shorter, and its armhole is cut deeper.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from warpflat.core.polyline import polyline_length
from warpflat.garment.garment import Garment
from warpflat.scene.load import load_scene, make_scene
from warpflat.scene.run_garment import plan_garment

SCENE = Path(__file__).parents[1] / "scenes" / "basic_block.toml"
SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44")
#: Of EU 38: the least and the greatest drafted value.
DRAFTED: dict[str, tuple[float, float]] = {
    "centre front": (368, 368),
    "centre back": (407, 407),
    "shoulder front": (104, 104),
    "shoulder back": (110, 110),
    "armhole front": (208, 216),
    "armhole back": (212, 221),
    "side seam": (184, 184),
    "waist front": (187, 194),
    "waist back": (177, 184),
    "bust dart": (63, 70),
    "waist dart front": (52, 59),
    "waist dart back": (17, 20),
    "hip front": (230, 232),
    "hip back": (250, 252),
    "skirt darts front": (30, 30),
    "skirt darts back": (37, 37),
    "area front": (743, 768),
    "area back": (703, 721),
    "area front skirt": (1247, 1260),
    "area back skirt": (1338, 1411),
}


#: Of `brian` by size: back and front.
DRAFTED_MEN: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "men 46": (
        {"centre": 423, "shoulder": 139, "side": 197, "width": 242, "neck": 86, "armhole": 211, "area": 945},
        {"centre": 380, "shoulder": 139, "side": 197, "width": 242, "neck": 109, "armhole": 211, "area": 919},
    ),
    "men 50": (
        {"centre": 426, "shoulder": 139, "side": 197, "width": 262, "neck": 89, "armhole": 225, "area": 1002},
        {"centre": 380, "shoulder": 139, "side": 197, "width": 262, "neck": 113, "armhole": 225, "area": 973},
    ),
    "men 54": (
        {"centre": 429, "shoulder": 139, "side": 197, "width": 282, "neck": 93, "armhole": 240, "area": 1060},
        {"centre": 382, "shoulder": 139, "side": 197, "width": 282, "neck": 118, "armhole": 241, "area": 1029},
    ),
}


def measured(garment: Garment) -> dict[str, float]:
    """Return the values of half a block [mm, cm2]."""
    metrics = garment.metrics()["pieces"]

    def along(piece: str, name: str) -> float:
        """Return the length of an edge or line, over all the parts into which darts divide it."""
        lines = garment.form.pieces[piece].surface.lines
        own = [ids for line, ids in lines.items() if line == name or line.removeprefix(f"{name} ").isdigit()]
        return 1e3 * sum(polyline_length(garment.pieces[piece].positions[ids]) for ids in own)

    def mouth(piece: str, *darts: str) -> float:
        found = {dart["name"]: dart["intake_m"] for dart in metrics[piece]["darts"]}
        return 1e3 * sum(found[f"{dart} left"] for dart in darts)

    def area(piece: str) -> float:
        return half_area(garment, piece)

    front, back = "front_bodice", "back_bodice"
    return {
        "centre front": along(front, "centre front"),
        "centre back": along(back, "centre back"),
        "shoulder front": along(front, "shoulder left"),
        "shoulder back": along(back, "shoulder left"),
        "armhole front": along(front, "armhole left"),
        "armhole back": along(back, "armhole left"),
        "side seam": along(front, "side left"),
        "waist front": 0.5 * along(front, "waist"),
        "waist back": 0.5 * along(back, "waist"),
        "bust dart": mouth(front, "bust dart"),
        "waist dart front": mouth(front, "waist dart"),
        "waist dart back": mouth(back, "waist dart"),
        "hip front": 0.5 * along("front_skirt", "hip"),
        "hip back": 0.5 * along("back_skirt", "hip"),
        "skirt darts front": mouth("front_skirt", "waist dart"),
        "skirt darts back": mouth("back_skirt", "waist dart", "second waist dart"),
        "area front": area(front),
        "area back": area(back),
        "area front skirt": area("front_skirt"),
        "area back skirt": area("back_skirt"),
    }


def half_area(garment: Garment, piece: str) -> float:
    """Return the area of half a piece [cm2]."""
    corners = garment.pieces[piece].positions[garment.pieces[piece].faces]
    x, y = corners[..., 0], corners[..., 1]
    return 1e4 * 0.25 * float(np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)))


def compare_men() -> None:
    """Print the bodices of men's sizes beside drafted ones."""
    for size, drafted in DRAFTED_MEN.items():
        table = {"form": "basic_block", "fabric": "woven", "ease": {"preset": "close", "bust": 5.0}}
        scene = make_scene({**table, "mannequin": {"size": size}}, name="men", folder=Path(), where=str(SCENE))
        garment = plan_garment(scene).flatten()
        print(f"{size}: {quality(garment)}")
        for face, there in zip(("back", "front"), drafted, strict=True):
            piece = f"{face}_bodice"
            lines, positions = garment.form.pieces[piece].surface.lines, garment.pieces[piece].positions
            own = {
                "centre": f"centre {face}",
                "shoulder": "shoulder left",
                "side": "side left",
                "armhole": "armhole left",
            }
            here = {key: 1e3 * polyline_length(positions[lines[line]]) for key, line in own.items()}
            here |= {
                key: 5e2 * polyline_length(positions[lines[line]])
                for key, line in {"width": "bust", "neck": "neck"}.items()
            }
            here["area"] = half_area(garment, piece)
            row = ", ".join(f"{key} {here[key]:.0f} ({value:g})" for key, value in there.items())
            print(
                f"  {face}, ours (drafted): {row}; waist {5e2 * polyline_length(positions[lines['waist']]):.0f}",
                flush=True,
            )


def quality(garment: Garment) -> str:
    """Return one line about flips, seams, girths, strain and price."""
    metrics = garment.metrics()
    girths = [abs(g["ease_m"] - g["ease_wanted_m"]) for g in metrics["girths"].values() if "ease_wanted_m" in g]
    seams = max(abs(seam["difference_mm"]) for seam in metrics["seams"])
    energy = sum(piece["model_energy_j"] for piece in metrics["pieces"].values())
    wears = [piece["wear"] for piece in metrics["pieces"].values()]
    return (
        f"converged {metrics['sewing']['converged']}, flips {sum(p['flipped_faces'] for p in metrics['pieces'].values())}, "
        f"seams within {seams:.3f} mm, girths within {1e3 * max(girths):.1f} mm, model energy {1e3 * energy:.0f} mJ, "
        f"fits: {sum(bool(wear.get('fits')) for wear in wears)} of {len(wears)} pieces"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", default=SIZES)
    parser.add_argument("--men", action="store_true", help="men's bodices instead")
    arguments = parser.parse_args()
    if arguments.men:
        compare_men()
        return
    sizes = arguments.sizes
    scene = load_scene(SCENE)
    columns: dict[str, dict[str, float]] = {}
    for size in sizes:
        table = scene.settings.model_dump(exclude_unset=True, by_alias=True)
        table["mannequin"] = {"size": size}
        start = time.perf_counter()
        garment = plan_garment(make_scene(table, name=scene.name, folder=scene.folder, where=str(SCENE))).flatten()
        columns[size] = measured(garment)
        print(f"{size}: {quality(garment)}, {time.perf_counter() - start:.1f} s", flush=True)
    print(f"\n{'':20}" + "".join(f"{size:>9}" for size in sizes) + f"{'drafted EU 38':>16}{'beyond':>9}")
    for name, (low, high) in DRAFTED.items():
        row = "".join(f"{columns[size][name]:9.0f}" for size in sizes)
        beyond = ""
        if "EU 38" in columns:
            own = columns["EU 38"][name]
            away = max(low - own, own - high, 0.0) * (1.0 if own > high else -1.0)
            beyond = f"{100 * away / (low + high) * 2:+.1f} %" if name.startswith("area") else f"{away:+.0f}"
        print(f"{name:20}{row}{f'{low:g}' if low == high else f'{low:g}-{high:g}':>16}{beyond:>9}")


if __name__ == "__main__":
    main()
