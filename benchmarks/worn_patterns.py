"""Patterns of others on a body: whether they come to rest there, how, and what it takes.

    python benchmarks/worn_patterns.py FILE ... [--body "EU 38"] [--spacing 20] [--fabric woven] [--pictures FOLDER]

Files: any that `warpflat drape` takes; a FILE.toml beside one names its seams. Bodies: a size, a wearer of `benchmarks/wardrobe.py`, such
as "tall man" or "child", or a scan's file. Each pattern has a process of its own.

Columns: whether the cloth is at rest, or what was said; largest strain along a thread [%]; mean gap to the body [mm]; edges that pierce
cloth elsewhere [%]; processor seconds; memory at most [MB].
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.app.scene.outside_pattern import OutsideJob
from warpflat.core.errors import InputError
from warpflat.flat.fabric.library import find_fabric
from warpflat.garment.draping.check_sewn import pierced_edges
from warpflat.garment.draping.drape_pattern import Placement, drape_pattern
from warpflat.garment.draping.picture import write_drape_picture
from warpflat.garment.mannequin.mannequin import Mannequin

sys.path.insert(0, str(Path(__file__).parent))
from wardrobe import WEARERS


def wearer(given: Mapping[str, Any]) -> Mannequin:
    """Return the mannequin of a wearer of the wardrobe."""
    lengths = given.get("measurements", {})
    return Mannequin.from_size(given["size"], **lengths) if "size" in given else Mannequin.from_measurements(**lengths)


def row(file: Path, body: str, spacing: float, fabric: str, pictures: Path | None) -> str:
    """Drape a pattern, and return the columns of its row."""
    began = time.process_time()
    sewing = file.with_suffix(".toml")
    try:
        job = OutsideJob.read(
            file, sewing=sewing if sewing.exists() else None, body="EU 38" if body in WEARERS else body
        )
        if body in WEARERS:
            job = replace(job, body=wearer(WEARERS[body]))
        placement = Placement(top=job.sewing.top, lifts=job.lifts, spacing=1e-3 * spacing)
        worn, _ = drape_pattern(job.pattern, job.body, fabric=find_fabric(fabric), placement=placement)
    except InputError as error:
        return f"refused: {error} | | | | {time.process_time() - began:.1f} | "
    if pictures is not None:
        write_drape_picture(pictures / f"{file.stem}_{Path(body).stem.replace(' ', '_')}.png", worn)
    strain = max(float(np.abs(worn.strains[name]).max()) for name in ("warp", "weft"))
    pierced = pierced_edges(worn.cloth, worn.positions)[0].mean()
    gap = float(worn.gap @ worn.areas / worn.areas.sum())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    rest = "yes" if worn.converged else f"no ({worn.worn.residual:.3g})"
    return (
        f"{rest} | {100.0 * strain:.1f} | {1e3 * gap:.1f} | {100.0 * pierced:.1f} | {time.process_time() - began:.1f} "
        f"| {memory:.0f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--body", default="EU 38")
    parser.add_argument("--spacing", type=float, default=20.0, help="of the mesh [mm]")
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each")
    given = parser.parse_args()
    if given.pictures is not None:
        given.pictures.mkdir(parents=True, exist_ok=True)
    print("pattern | at rest | largest strain % | gap mm | edges that pierce cloth % | processor s | MB", flush=True)
    for file in given.files:
        # A process of its own has its own memory and time.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            columns = pool.submit(row, file, given.body, given.spacing, given.fabric, given.pictures).result()
        print(f"{file.stem} | {columns}", flush=True)


if __name__ == "__main__":
    main()
