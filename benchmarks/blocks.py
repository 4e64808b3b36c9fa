"""Compare the darted basic block with a drafted one, size by size.

    python benchmarks/blocks.py [--sizes "EU 36" "EU 38" ...]

The scene is `scenes/basic_block.toml`, as it ships. The drafted blocks are in `drafted_blocks.json`. FreeSewing's public designs
`bella` (bodice), `penelope` (skirt) and `brian` (men) 4.10.2 (MIT licence) drafted them for the lengths, girths, shoulders, depth of
the armhole and ease of the package's own forms (`draft_blocks.mjs`; `--inputs` prints what it is given). Two drafts span a
range. `bella` makes its back a quarter of the underbust's girth, which puts the side seam some 30 mm farther back than a form's;
the second draft has the side seam at a quarter of the bust, as the form has it. All values are of half a piece [mm; areas in
cm2]. `beyond` is how far ours lies outside that range.

    python benchmarks/blocks.py --men

compares the bodice of three men's sizes, without darts and with 5 cm of ease at the chest. `brian` is a boxy block: its side is
straight down. Its area is therefore also told less the wedge between that side and the waist of ours. Its second draft has the
design's own ease of the armhole, 9.5 % of the way from waist to armpit.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.app.scene.load import load_scene, make_scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.core.polyline import polyline_length
from warpflat.flat.model.fit import TOLERATED
from warpflat.garment.construction.garment import Garment

SCENE = Path(__file__).parents[1] / "scenes" / "basic_block.toml"
SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44")
DRAFTED = Path(__file__).with_name("drafted_blocks.json")
MEN = ("men 46", "men 50", "men 54")


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


def flattened(size: str) -> Garment:
    """Return the block in a size: the shipped scene's, or a man's without darts."""
    if size.startswith("men"):
        table: dict[str, Any] = {"form": "basic_block", "fabric": "woven", "ease": {"preset": "close", "bust": 5.0}}
    else:
        table = load_scene(SCENE).settings.model_dump(exclude_unset=True, by_alias=True)
    scene = make_scene({**table, "mannequin": {"size": size}}, name="block", folder=SCENE.parent, where=str(SCENE))
    return plan_form_scene(scene).flatten()


def bodice_values(garment: Garment, face: str) -> dict[str, float]:
    """Return the values of half a man's front or back bodice [mm, cm2]."""
    piece = f"{face}_bodice"
    lines, positions = garment.form.pieces[piece].surface.lines, garment.pieces[piece].positions
    whole = {"centre": f"centre {face}", "shoulder": "shoulder left", "side": "side left", "armhole": "armhole left"}
    found = {key: 1e3 * polyline_length(positions[lines[line]]) for key, line in whole.items()}
    half = {"width": "bust", "neck": "neck", "waist": "waist"}
    found |= {key: 5e2 * polyline_length(positions[lines[line]]) for key, line in half.items()}
    return {**found, "area": half_area(garment, piece)}


def compare_men(sizes: Sequence[str]) -> None:
    """Print the bodices of men's sizes beside drafted ones."""
    drafted = json.loads(DRAFTED.read_text(encoding="utf-8"))
    for size in sizes:
        garment = flattened(size)
        print(f"{size}: {quality(garment)}")
        for face in ("back", "front"):
            own = bodice_values(garment, face)
            found = []
            for key in (key for key in own if key in drafted[size][0][face]):
                low, high = sorted(draft[face][key] for draft in drafted[size])
                found.append(f"{key} {own[key]:.0f} ({low}-{high}, {beyond(key, own[key], low, high)})")
            # Ours is fitted at the waist: a triangle from the underarm to the waist is missing at the side.
            least = min(
                draft[face]["area"] - 0.005 * (draft[face]["width"] - own["waist"]) * draft[face]["side"]
                for draft in drafted[size]
            )
            print(f"  {face}, ours (drafted): {', '.join(found)}; area fitted at the waist {least:.0f} "
                  f"({100 * (own['area'] / least - 1):+.1f} %)", flush=True)  # fmt: skip


def beyond(name: str, own: float, low: float, high: float) -> str:
    """Return how far a value lies outside a range, in mm or, of an area, in percent."""
    away = max(low - own, own - high, 0.0) * (1.0 if own > high else -1.0)
    if name.startswith("area"):
        return f"{100 * away / (0.5 * (low + high)) + 0.0:+.1f} %"
    return f"{away + 0.0:+.0f}"


def drafting_inputs(size: str) -> dict[str, Any]:
    """Return what the drafting program is given: lengths [mm], angles [degrees] and ease of a form on its body."""
    garment = flattened(size)
    body, girths = garment.mannequin, garment.metrics()["girths"]
    layout, at = body.layout, body.vertices
    levels = body.metrics()["levels"]
    girth = {
        name: 1e3 * levels[name]["girth_m"] for name in ("bust", "underbust", "waist", "hip", "neck", "biceps left")
    }
    height = {
        name: float(at[layout.rings[layout.level_row[name]], 1].mean()) for name in ("bust", "waist", "hip", "knee")
    }
    ease = {name: own["pattern_m"] / own["body_m"] - 1.0 for name, own in girths.items()}
    shoulder = at[layout.lines["shoulder left"]]
    top, tip = shoulder[shoulder[:, 1].argmax()], shoulder[shoulder[:, 1].argmin()]
    princess = at[layout.lines["princess front left"]]
    given = {
        "chest": girth["bust"],
        "waist": girth["waist"],
        "neck": girth["neck"],
        "biceps": girth["biceps left"],
        "hpsToBust": 1e3 * polyline_length(princess[princess[:, 1] >= height["bust"] - 1e-6]),
        "shoulderToShoulder": 2e3 * float(tip[0]),
        "shoulderSlope": float(np.degrees(np.arctan2(top[1] - tip[1], np.hypot(*(tip - top)[[0, 2]])))),
        "waistToArmpit": 1e3 * (float(at[layout.lines["side left"], 1].max()) - height["waist"]),
    }  # fmt: skip
    if size.startswith("men"):
        lengths = {face: bodice_values(garment, face) for face in ("back", "front")}
        given |= {"hpsToWaistBack": lengths["back"]["centre"] + 0.05 * girth["neck"], "waistToHips": 110.0}
        return {"measurements": given, "lengths": lengths, "brian": {"chestEase": ease["bust"]}}
    own = measured(garment)
    ring = at[layout.rings[layout.level_row["waist"]]]
    to_seat = 1e3 * (height["waist"] - height["hip"])
    given |= {
        "highBust": 0.95 * girth["bust"],
        "bustSpan": 1e3 * 0.205 * levels["bust"]["girth_m"],
        "waistBack": 1e3 * polyline_length(ring[layout.quarter : 3 * layout.quarter + 1]),
        "hpsToWaistFront": own["centre front"] + 0.19 * girth["neck"],
        "hpsToWaistBack": own["centre back"] + 0.06 * girth["neck"],
        "seat": girth["hip"],
        "seatBack": girth["hip"] * own["hip back"] / (own["hip back"] + own["hip front"]),
        "waistToHips": 0.5 * to_seat,
        "waistToSeat": to_seat,
        "waistToKnee": 1e3 * (height["waist"] - height["knee"]),
    }
    return {
        "measurements": given,
        "underbusts": [girth["underbust"], girth["bust"]],
        "lengths": own,
        "bella": {"chestEase": ease["bust"], "waistEase": ease["waist"]},
        "penelope": {"waistEase": ease["waist"], "seatEase": ease["hip"]},
    }


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
        f"fits: {sum(wear['held'] <= TOLERATED for wear in wears)} of {len(wears)} pieces"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+")
    parser.add_argument("--men", action="store_true", help="men's bodices instead")
    parser.add_argument("--inputs", action="store_true", help="print what the drafting program is given")
    arguments = parser.parse_args()
    sizes = arguments.sizes or (MEN if arguments.men else SIZES)
    if arguments.inputs:
        print(json.dumps({size: drafting_inputs(size) for size in (*sizes, *MEN)}, indent=1))
        return
    if arguments.men:
        compare_men(sizes)
        return
    drafted = json.loads(DRAFTED.read_text(encoding="utf-8"))
    columns: dict[str, dict[str, float]] = {}
    for size in sizes:
        start = time.process_time()
        garment = flattened(size)
        columns[size] = measured(garment)
        print(f"{size}: {quality(garment)}, {time.process_time() - start:.1f} s", flush=True)
    print(f"\nours (drafted, beyond)\n{'':20}" + "".join(f"{size:>24}" for size in sizes))
    for name in columns[sizes[0]]:
        row = []
        for size in sizes:
            low, high = sorted(draft[name] for draft in drafted[size])
            words = f"{low}" if low == high else f"{low}-{high}"
            row.append(f"{columns[size][name]:.0f} ({words}, {beyond(name, columns[size][name], low, high)})")
        print(f"{name:20}" + "".join(f"{words:>24}" for words in row))


if __name__ == "__main__":
    main()
