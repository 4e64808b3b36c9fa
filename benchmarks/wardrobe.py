"""Make every garment of the wardrobe for six wearers, and say whether each fits and can be sewn from what is printed.

    python benchmarks/wardrobe.py [--garments shirt hoodie ...] [--wearers "EU 36" pear ...] [--options] [--out DIR]

The wearers: three sizes of the table, somebody with narrow shoulders and wide hips, a tall man, and a child; a body scan where it is
asked for (needs `WARPFLAT_DATA`). `--options` makes each garment with every option of its choices too, the others left as they are.

A row has the exit code that `warpflat run` gives, and what its verdict says: whether it fits, the share of the cloth that is held beyond
its limit, the share in folds, the largest miss of an ease that was asked for [mm]. Then the pattern: pieces, the largest difference
between the sides of a seam [mm], the largest distance between notches that should meet [mm], edges that no step uses up, steps, whether
each seam comes after those that end on its line, and seconds of the processor. What fails is said below its row.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from warpflat.app.scene.load import load_scene
from warpflat.app.scene.run import run_scene
from warpflat.app.scene.wardrobe import GarmentOffer, garment_offer, offers, scene_text
from warpflat.core.errors import InputError
from warpflat.core.text import other_side
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.pieces import SeamSide
from warpflat.pattern.drafting.sewing_order import SewingStep, sewing_steps
from warpflat.pattern.export.pattern_json import read_pattern_json

WEARERS: Mapping[str, Mapping[str, Any]] = {
    "EU 36": {"size": "EU 36"},
    "EU 40": {"size": "EU 40"},
    "EU 46": {"size": "EU 46"},
    "pear": {"measurements": {"bust": 0.86, "waist": 0.72, "hip": 1.06, "stature": 1.64}},
    "tall man": {"size": "men 50", "measurements": {"stature": 1.94}},
    "child": {"measurements": {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28}},
    "scan": {"scan": "${WARPFLAT_DATA}/body_female.obj"},
}
COLUMNS = "exit fits  held  folds ease  pieces  seam notches open steps order    s"


def variants(offer: GarmentOffer, *, options: bool) -> Iterator[dict[str, str]]:
    """Yield the garment as it is, and with every other option of its choices, one at a time."""
    yield {}
    if options:
        for choice, known in offer.choices.items():
            yield from ({choice: option} for option in list(known)[1:])


def edges_left(garment: DraftedGarment, size: str, steps: list[SewingStep]) -> int:
    """Return how many edges no seam joins and no step finishes; those that are left raw, or to the maker, are among them."""
    joined = {side.place for seam in garment.pattern.seams for side in seam.stretches}
    joined |= {(piece, other_side(edge)) for piece, edge in joined}
    used = {place for step in steps if step.technique not in ("raw", "bind_raw") for place in step.finished}
    every = {(p.name, e.name) for p in garment.pieces[size] for e in p.edges if e.kind not in ("fold", "dart")}
    return len(every - joined - used)


def sewn_too_late(garment: DraftedGarment, size: str, steps: list[SewingStep]) -> list[str]:
    """Return seams that are sewn before one that ends on their line."""
    edges = {piece.name: [edge.name for edge in piece.edges] for piece in garment.pieces[size]}

    def corner(side: SeamSide, *, end: bool) -> tuple[str, bool, int, int]:
        at = edges[side.piece].index(side.edge) + (end != side.reversed)
        return side.piece, side.mirrored, side.copy, at % len(edges[side.piece])

    seams, number = garment.pattern.seams, dict[str, int]()
    for at, step in enumerate(steps):
        for seam in seams:
            if all(side.edge in step.sewn.get(side.piece, ()) for side in seam.stretches):
                number.setdefault(seam.name, at)
    ends = {
        frozenset(corner(row[-1 if end else 0], end=end) for row in seam.sides): seam.name
        for seam in seams
        for end in (False, True)
    }
    late = []
    for seam in seams:
        for row in seam.sides:
            meeting = [frozenset((corner(one, end=True), corner(other, end=False))) for one, other in pairwise(row)]
            late += [
                f"{seam.name} is sewn before {ends[pair]}"
                for pair in meeting
                if pair in ends and number[ends[pair]] > number[seam.name]
            ]
    return late


def row(offer: GarmentOffer, wearer: str, chosen: Mapping[str, str], out: Path | None) -> str:
    """Make one garment for one wearer, and return what came out in one line, and one for each thing that fails."""
    start = time.process_time()
    name = "_".join([offer.name, wearer.replace(" ", "_"), *chosen.values()])
    head = f"{offer.name + ' ' + ' '.join(chosen.values()):<28} {wearer:<9}"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(scene_text(offer, WEARERS[wearer], chosen, file=file.name), encoding="utf-8")
        folder_of_run = Path(folder) / "out" if out is None else out / name
        try:
            scene = load_scene(file)
            output = scene.settings.output.model_copy(
                update={"frames": 0, "review": out is not None, "picture": out is not None}
            )
            formats = ["json"] if out is None else [*dict.fromkeys([*scene.settings.pattern.formats, "json"])]
            pattern = scene.settings.pattern.model_copy(update={"formats": formats})
            settings = scene.settings.model_copy(update={"output": output, "pattern": pattern})
            metrics = run_scene(type(scene)(**{**vars(scene), "settings": settings}), folder_of_run).metrics
        except InputError as error:
            return f"{head} exit 2: {error}"
        if "not_drawn" in metrics["pattern"]:
            return f"{head} exit 1: {metrics['pattern']['not_drawn']}"
        drafted = read_pattern_json(folder_of_run / "pattern.json")
    size = next(iter(drafted.pieces))
    steps = list(sewing_steps(drafted, size))
    rested = all(p["stages"][-1]["converged"] and not p["flipped_faces"] for p in metrics["pieces"].values())
    verdict, wear = metrics.get("verdict"), metrics.get("wear", {})
    girths = metrics.get("girths", {}).values()
    missed = [abs(each["ease_m"] - each["ease_wanted_m"]) for each in girths if "ease_wanted_m" in each]
    apart = [seam.notches_mm for seam in drafted.seams if seam.notches_mm is not None]
    late = sewn_too_late(drafted, size, steps)
    says = "-" if verdict is None else "yes" if verdict["fits"] else "NO"
    lines = [
        f"{head} {0 if rested else 1:>4} {says:>4} {wear.get('held', 0.0):>5.1%} {wear.get('slack', 0.0):>6.1%} "
        f"{1e3 * max(missed, default=0.0):>4.0f} {sum(len(cloth['pieces']) for cloth in metrics['cloths']):>7} "
        f"{metrics['pattern']['seam_difference_mm'] or 0.0:>5.2f} {max(apart, default=0.0):>7.2f} "
        f"{edges_left(drafted, size, steps):>4} {len(steps):>5} {'LATE' if late else 'good':>5} {time.process_time() - start:>4.0f}"
    ]
    failing = [each for each in (verdict or {"findings": ()})["findings"] if each["fails"]]
    return "\n".join(
        [*lines, *(f"    {each['words']}; {each['remedy']}" for each in failing), *(f"    {x}" for x in late)]
    )


def main() -> None:
    """Print a row for each garment and wearer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--garments", nargs="*", default=list(offers()), metavar="NAME")
    parser.add_argument(
        "--wearers", nargs="*", default=[name for name in WEARERS if name != "scan"], choices=list(WEARERS)
    )
    parser.add_argument("--options", action="store_true")
    parser.add_argument("--out", type=Path, help="keep the files of all runs here")
    arguments = parser.parse_args()
    print(f"{'garment':<28} {'wearer':<9} {COLUMNS}")
    for name in arguments.garments:
        offer = garment_offer(name)
        for wearer in arguments.wearers if offer.on_body or offer.of_body else arguments.wearers[:1]:
            if wearer == "scan" and (not offer.on_body or "WARPFLAT_DATA" not in os.environ):
                continue
            for chosen in variants(offer, options=arguments.options):
                print(row(offer, wearer, chosen, arguments.out), flush=True)


if __name__ == "__main__":
    main()
