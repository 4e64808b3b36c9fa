"""Make every garment of the wardrobe for six wearers, and say whether each comes out as one would sew it.

    python benchmarks/wardrobe.py [--garments shirt hoodie ...] [--wearers small pear ...] [--options] [--out DIR]

The wearers: two ends of the size table, somebody with narrow shoulders and wide hips, a tall man, a child, and a body scan
(needs `WARPFLAT_DATA`). `--options` makes each garment with every option of its choices too, the others left as they are.

A row has: the exit code that `warpflat run` would give, mirrored faces, the largest difference between the sides of a seam [mm], rings
that do not pass, pieces, the share of the cloth beyond its strain limit, sheets of A4 with the guide, and seconds of the processor.
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from warpflat.core.errors import InputError
from warpflat.scene.load import load_scene
from warpflat.scene.run import run_scene
from warpflat.scene.wardrobe import GarmentOffer, garment_offer, offers, scene_text

WEARERS: Mapping[str, Mapping[str, Any]] = {
    "small": {"size": "EU 36"},
    "large": {"size": "EU 44"},
    "pear": {"measurements": {"bust": 0.86, "waist": 0.72, "hip": 1.06, "stature": 1.64}},
    "tall man": {"size": "men 50", "measurements": {"stature": 1.94}},
    "child": {"measurements": {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28}},
    "scan": {"scan": "${WARPFLAT_DATA}/body_female.obj"},
}


def variants(offer: GarmentOffer, *, options: bool) -> Iterator[dict[str, str]]:
    """Yield the garment as it is, and with every other option of its choices, one at a time."""
    yield {}
    if options:
        for choice, known in offer.choices.items():
            yield from ({choice: option} for option in list(known)[1:])


def row(offer: GarmentOffer, wearer: str, chosen: Mapping[str, str], out: Path | None) -> str:
    """Make one garment for one wearer, and return what came out in one line."""
    start = time.process_time()
    name = "_".join([offer.name, wearer.replace(" ", "_"), *chosen.values()])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(scene_text(offer, WEARERS[wearer], chosen, file=file.name), encoding="utf-8")
        head = f"{offer.name + ' ' + ' '.join(chosen.values()):<28} {wearer:<9}"
        try:
            scene = load_scene(file)
            update = {
                "output": scene.settings.output.model_copy(
                    update={"frames": 0, "review": False, "picture": out is not None}
                )
            }
            scene = type(scene)(**{**vars(scene), "settings": scene.settings.model_copy(update=update)})
            folder_of_run = Path(folder) / "out" if out is None else out / name
            metrics = run_scene(scene, folder_of_run).metrics
            pdf = folder_of_run / "pattern.pdf"
            sheets = len(re.findall(rb"/Type /Page\b", pdf.read_bytes())) if pdf.exists() else 0
        except InputError as error:
            return f"{head} exit 2: {error}"
    pieces, pattern = metrics["pieces"].values(), metrics["pattern"]
    flips = sum(piece["flipped_faces"] for piece in pieces)
    converged = all(piece["stages"][-1]["converged"] for piece in pieces)
    shut = [ring["name"] for ring in metrics.get("rings", ()) if ring["passes"] is False]
    if "not_drawn" in pattern:
        return f"{head} exit 1: {pattern['not_drawn']}"
    drawn = sum(len(cloth["pieces"]) for cloth in metrics["cloths"])
    beyond = metrics.get("wear", {}).get("outside", 0.0)
    return (
        f"{head} {0 if converged and not flips else 1:>4} {flips:>5} {pattern['seam_difference_mm'] or 0.0:>6.2f} "
        f"{', '.join(shut) or 'pass':<12} {drawn:>6} {beyond:>7.2%} {sheets:>6} {time.process_time() - start:>6.0f}"
    )


def main() -> None:
    """Print a row for each garment and wearer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--garments", nargs="*", default=list(offers()), metavar="NAME")
    parser.add_argument("--wearers", nargs="*", default=list(WEARERS), choices=list(WEARERS), metavar="NAME")
    parser.add_argument("--options", action="store_true")
    parser.add_argument("--out", type=Path, help="keep the files of all runs here")
    arguments = parser.parse_args()
    print(f"{'garment':<28} {'wearer':<9} exit flips   seam rings        pieces  beyond sheets      s")
    for name in arguments.garments:
        offer = garment_offer(name)
        for wearer in arguments.wearers if offer.on_body or offer.of_body else arguments.wearers[:1]:
            if wearer == "scan" and not offer.on_body:
                continue
            if wearer == "scan" and "WARPFLAT_DATA" not in os.environ:
                continue
            for chosen in variants(offer, options=arguments.options):
                print(row(offer, wearer, chosen, arguments.out), flush=True)


if __name__ == "__main__":
    main()
