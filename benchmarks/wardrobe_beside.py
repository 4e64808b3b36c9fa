"""Compare garments of the wardrobe with drafted ones: the same measurements and ease, key lengths side by side.

    python benchmarks/wardrobe_beside.py [--sizes "men 50" ...]

FreeSewing's public designs `teagan` (T-shirt), `simon` (shirt) and `charlie` (trousers) 4.10.2 (MIT licence) drafted the others for the
measurements of the package's own bodies, and for the ease of its garments where a design asks for that (`draft_wardrobe.mjs`;
`--inputs` prints what it is given). They are drafts for men; of women they have no bust. All lengths are of the whole garment [mm].

Differences of more than 15 mm in men 50 (`*`). Sleeves have 60 and 80 mm of ease at the biceps here, 15 % of it there, 47 mm; with them
go longer armholes. A woven cap has 5.5 % more than its armhole here, none there. A cuff is 85 % of a wrist with 70 mm of ease, and its
overlap of 25 mm. A knit with ease is not held to its girth: the T-shirt's chest, 1,080 mm on the form, is 1,058 at rest in the plane,
because a surface without darts that bulges comes out 2 % narrower and the cloth gives that back. Trousers end at the ankle here, 106 mm
above the floor, and at the floor there. The crotch lies 15 mm below the body's here, 6 mm there, and the waist seam there lies 11 mm
lower, under a waistband. So crotch seams are 19 to 21 mm longer here (8 for the crotch, 11 for the waistband), the outseam is 92 mm
shorter (-106 + 11), the inseam 131 (-106, -9 for the crotch, -12 for the slant of a fork that reaches farther there, and -4). They taper
down to the hem here; from the knee on they are straight there, as wide as that hem.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.app.scene.wardrobe import garment_offer, scene_text
from warpflat.core.polyline import polyline_length
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.draft import draft_garment

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DRAFTED = Path(__file__).with_name("drafted_wardrobe.json")
SIZES = ("men 50",)
GARMENTS = ("tshirt", "shirt", "trousers")
# Differences beyond this are to be explained [mm].
TOLD = 15.0


def flattened(name: str, size: str) -> tuple[Garment, dict[str, Any]]:
    """Return a garment of the wardrobe, and its drafted pieces by name."""
    text = scene_text(garment_offer(name), {"size": size}, {}, file="x.toml")
    plan = plan_form_scene(make_scene(tomllib.loads(text), name=name, folder=Path(), where=name))
    garment = plan.flatten()
    pattern, _ = pattern_of_garment({"": garment}, name=name, rules=plan.drawing.rules)
    return garment, {piece.name: piece for piece in draft_garment(pattern).pieces[""]}


def own_lengths(name: str, size: str) -> dict[str, float]:
    """Return the key lengths of a garment [mm]."""
    garment, pieces = flattened(name, size)
    girths = garment.metrics()["girths"]
    front = pieces.get("front") or pieces["front_left"]
    back = pieces.get("back") or pieces["back_left"]

    def along(piece: Any, line: str) -> float:
        own = [edge for edge in piece.edges if edge.name == line or edge.name.removeprefix(f"{line} ").isdigit()]
        return 1e3 * sum(edge.length for edge in own)

    if name == "trousers":
        return {
            "seat": 1e3 * girths["hip"]["pattern_m"],
            "inseam": along(back, "inseam left"),
            "outseam": along(back, "outseam left"),
            "crotch front": along(front, "crotch front"),
            "crotch back": along(back, "crotch back"),
            "hem": along(front, "ankle left") + along(back, "ankle left"),
            "knee": 1e3 * sum(polyline_length(p.internal_lines["knee left"]) for p in (front, back)),
        }
    sleeve = pieces["sleeve_left"]
    found = {
        "chest": 1e3 * girths["bust"]["pattern_m"],
        "armhole, one": along(front, "armhole left") + along(back, "armhole left"),
        "sleeve cap": along(sleeve, "armhole left"),
        "sleeve at biceps": along(sleeve, "biceps left") or 1e3 * polyline_length(sleeve.internal_lines["biceps left"]),
        "shoulder front": along(front, "shoulder left"),
    }
    if name == "shirt":
        stand = pieces["collar_stand"].edge("lower").length - 2 * 0.018
        found |= {"neck": 1e3 * stand, "cuff": 1e3 * pieces["cuff"].edge("upper").length}
    return found


def drafting_inputs(size: str) -> dict[str, Any]:
    """Return what the drafting program is given of a body: lengths [mm], angles [degrees]; and the ease of the garments [shares]."""
    body = Mannequin.from_size(size)
    at, lines, levels = body.vertices, body.layout.lines, body.levels()
    girth = {name: 1e3 * level.girth for name, level in levels.items()}
    height = {name: 1e3 * level.height for name, level in levels.items()}
    shoulder = at[lines["shoulder left"]]
    top, tip = shoulder[shoulder[:, 1].argmax()], shoulder[shoulder[:, 1].argmin()]

    def part(line: str, low: str, high: str) -> float:
        ids = lines[line]
        kept = at[ids][(at[ids, 1] >= at[lines[low][0], 1] - 1e-6) & (at[ids, 1] <= at[lines[high], 1].max() + 1e-6)]
        return 1e3 * polyline_length(kept)

    front, back = (part(f"centre {face}", "hip", "waist") for face in ("front", "back"))
    row = at[lines["hip"]]
    waist_row = at[lines["waist"]]
    half = len(row) // 4

    def behind(points: Any) -> float:
        return 1e3 * polyline_length(points[half : 3 * half + 1])

    measurements = {
        "biceps": girth["biceps left"], "chest": girth["bust"], "neck": girth["neck"], "waist": girth["waist"], "hips": girth["abdomen"],
        "seat": girth["hip"], "knee": girth["knee left"], "wrist": girth["wrist left"], "heel": 1e3 * body.lengths["foot"],
        "seatBack": behind(row) * girth["hip"] / (1e3 * polyline_length(row)),
        "waistBack": behind(waist_row) * girth["waist"] / (1e3 * polyline_length(waist_row)),
        "shoulderToShoulder": 2e3 * float(tip[0]),
        "shoulderSlope": float(np.degrees(np.arctan2(top[1] - tip[1], np.hypot(*(tip - top)[[0, 2]])))),
        "hpsToBust": 1e3 * (float(top[1]) - height["bust"] / 1e3),
        "hpsToWaistBack": part("centre back", "waist", "neck") + 0.05 * girth["neck"],
        "waistToArmpit": 1e3 * float(at[lines["side left"], 1].max()) - height["waist"],
        "waistToHips": height["waist"] - height["abdomen"], "waistToSeat": height["waist"] - height["hip"],
        "waistToKnee": height["waist"] - height["knee left"], "waistToFloor": height["waist"],
        "waistToUpperLeg": height["waist"] - height["crotch front"],
        "shoulderToWrist": 1e3 * body.lengths["arm_length"],
        "crossSeam": front + back + girth["crotch front"] + girth["crotch back"],
        "crossSeamFront": front + girth["crotch front"],
    }  # fmt: skip
    return {
        "tshirt": {"measurements": measurements, "options": {"chestEase": 80 / girth["bust"], "s3Collar": 0, "s3Armhole": 0}},
        "shirt": {
            "measurements": measurements,
            "options": {"chestEase": 100 / girth["bust"], "collarEase": 0, "s3Collar": 0, "s3Armhole": 0},
        },
        "trousers": {
            "measurements": measurements,
            "options": {
                "waistHeight": 1, "lengthBonus": 0, "seatEase": 30 / girth["hip"], "waistEase": 10 / girth["waist"],
                "waistbandWidth": 0.01,
            },
        },
    }  # fmt: skip


def compare(sizes: Sequence[str]) -> None:
    """Print each key length: own, drafted, and the difference; what is farther than `TOLD` apart has a star."""
    drafted = json.loads(DRAFTED.read_text(encoding="utf-8"))
    for size in sizes:
        for name in GARMENTS:
            print(f"{size} {name:<20} {'own':>6} {'drafted':>8} {'more':>6}")
            for key, value in own_lengths(name, size).items():
                other = drafted[size][name][key]
                print(
                    f"  {key:<25} {value:6.0f} {other:8.0f} {value - other:6.0f}{' *' if abs(value - other) > TOLD else ''}"
                )


def main() -> None:
    """Print the comparison, or what the drafting program is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="*", default=list(SIZES), metavar="SIZE")
    parser.add_argument("--inputs", action="store_true")
    arguments = parser.parse_args()
    if arguments.inputs:
        print(json.dumps({size: drafting_inputs(size) for size in arguments.sizes}))
    else:
        compare(arguments.sizes)


if __name__ == "__main__":
    main()
