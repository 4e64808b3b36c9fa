"""Run the woven garments in every size and hold each against what a sewn pattern must keep.

    python benchmarks/sizes.py [--scenes basic_block ...] [--sizes "EU 36" ...]

One line per scene and size: flipped faces; the largest share of a piece's cloth beyond its strain limit and the worst
strain, both against the form; the largest difference of a seam's sides [mm]; the corner of sewn edges farthest from what
it should be (180 degrees, 90 at a centre line); the girth farthest from what is wanted [mm]; drawn borders that still bend
back and forth, and what drawing costs [mJ]. `OVER` names what is out of bounds. Men wear no dress: their sizes run block
and trousers.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpflat.app.scene.load import load_scene, make_scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.flat.model.fit import TOLERATED
from warpflat.garment.construction.garment_files import garment_files

SCENES = Path(__file__).parents[1] / "scenes"
GARMENTS = ("basic_block", "dress", "princess_dress", "zip_skirt", "trousers")
SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44", "men 46", "men 50", "men 54")
#: Bounds: share of a piece's cloth beyond its limit, seams [mm], corners [degrees from 180], girths [mm].
BOUNDS = {"outside": 0.01, "seams": 0.2, "corners": 1.0, "girths": 2.0, "flips": 0}


def measure(scene_name: str, size: str) -> dict[str, Any]:
    """Flatten, sew and draw a scene in a size, and return its figures."""
    scene = load_scene(SCENES / f"{scene_name}.toml")
    table = scene.settings.model_dump(exclude_unset=True, by_alias=True)
    table["mannequin"] = {"size": size}
    plan = plan_form_scene(make_scene(table, name=scene.name, folder=scene.folder, where=scene_name))
    garment = plan.flatten()
    metrics = garment.metrics()
    with tempfile.TemporaryDirectory() as folder:
        options = replace(plan.drawing, formats=("json",))
        drawn = garment_files({size: garment}, Path(folder), name=scene_name, options=options).metrics
    wears = [piece["wear"] for piece in metrics["pieces"].values()]
    strains = [abs(w[f"strain_{thread}"][end]) for w in wears for thread in ("warp", "weft") for end in ("min", "max")]
    girths = [abs(g["ease_m"] - g["ease_wanted_m"]) for g in metrics["girths"].values() if "ease_wanted_m" in g]
    corners = [abs(corner["after_deg"] - corner["wanted_deg"]) for corner in drawn.get("corners", ())]
    curves = metrics.get("curves", {"lines": [], "price_j": 0.0})
    return {
        "flips": sum(piece["flipped_faces"] for piece in metrics["pieces"].values()),
        "outside": max(wear["outside"] for wear in wears),
        "strain": max(strains),
        "seams": max(abs(seam["difference_mm"]) for seam in metrics["seams"]),
        "corners": max(corners, default=0.0),
        "girths": 1e3 * max(girths, default=0.0),
        "bends": sum(max(0, line["inflections_after"] - 1) for line in curves["lines"]),
        "drawn": 1e3 * curves["price_j"],
        "converged": metrics["sewing"]["converged"],
        "wearer": metrics["verdict"]["fits"],
        "where": next((place for wear in wears for place in wear["where_not"] if wear["held"] > TOLERATED), ""),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=GARMENTS)
    parser.add_argument("--sizes", nargs="+", default=SIZES)
    arguments = parser.parse_args()
    print(
        f"{'scene':15}{'size':8}{'flips':>6}{'beyond':>8}{'strain':>8}{'seams':>8}{'corners':>9}{'girths':>8}{'bends':>7}{'drawn':>8}"
    )
    for scene in arguments.scenes:
        for size in arguments.sizes:
            if size.startswith("men") and scene not in ("basic_block", "trousers"):
                continue
            row = measure(scene, size)
            over = [name for name, bound in BOUNDS.items() if row[name] > bound]
            over += [word for word in ("converged", "wearer") if not row[word]]
            words = (
                f"  OVER: {', '.join(over)}{'; ' if row['where'] else ''}{row['where'].partition(' (limit')[0]}"
                if over
                else ""
            )
            print(
                f"{scene:15}{size:8}{row['flips']:6d}{100 * row['outside']:7.2f}%{100 * row['strain']:7.1f}%{row['seams']:8.3f}"
                f"{row['corners']:9.2f}{row['girths']:8.2f}{row['bends']:7d}{row['drawn']:8.1f}{words}",
                flush=True,
            )


if __name__ == "__main__":
    main()
