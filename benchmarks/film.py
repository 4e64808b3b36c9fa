"""Figures of the films of scenes: how many frames, how much moves in one, and what film and review page add to a run.

    OMP_NUM_THREADS=1 python benchmarks/film.py [SCENE.toml ...] [--repeats 3] [--figures] [--compact]

A row per scene. `frames` is their number, `stages` how many each stage has. `largest share` is the way of the vertex that moves
farthest in one frame, as a share of the largest displacement in its stage, over all pieces. `run` is the processor time of the
whole command, a process of its own with compiled kernels. `film` and `page` are what it spends on `frames.usdc` and on
`review.html`, libraries loaded for them among it; `share` is both of the run. `MB` are their sizes, `other` is that of all other
files, the first share is that of film and page in all bytes. The fastest of the repeats counts. `white` is the share of each
picture that is white or nearly so. `--figures` runs each scene once. `--compact` writes compact films.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import warpflat
from warpflat.core.errors import InputError
from warpflat.pattern.export.usd_prims import part_path

SCENES = Path(__file__).parents[1] / "scenes"


def largest_shares(film: Path) -> tuple[int, list[int], float]:
    """Return the number of frames of a film, that of each stage, and the largest share of a stage's way in one frame."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(film))
    worst, counts, frames = 0.0, list[int](), 0
    for piece in stage.GetDefaultPrim().GetChildren():
        pattern = UsdGeom.Mesh(stage.GetPrimAtPath(part_path(str(piece.GetPath()), "pattern")))
        if not pattern:
            continue
        # Between two samples USD interpolates: a frame is what a reader gets at its time.
        times = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
        number = piece.GetAttribute("warpflat:stage_number")
        still = pattern.GetFaceVertexIndicesAttr().GetTimeSamples()
        shots: dict[tuple[int, int], list[Any]] = {}
        for at in times:
            key = number.Get(at), sum(change <= at for change in still)
            shots.setdefault(key, []).append(np.array(pattern.GetPointsAttr().Get(at), dtype=np.float64))
        frames, counts = len(times), [len(shot) for shot in shots.values()]
        for shot in shots.values():
            way = max(np.linalg.norm(points - shot[0], axis=1).max() for points in shot)
            if way > 1e-6:
                moves = (np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(shot))
                worst = max(worst, *(move / way for move in moves))
    return frames, counts, worst


def white_shares(folder: Path) -> dict[str, float]:
    """Return the share of each picture of a folder that is paper: no channel is below 0.94 of white."""
    from PIL import Image

    found = {}
    for path in sorted(folder.glob("*.png")):
        with Image.open(path) as picture:
            found[path.stem] = float((np.asarray(picture.convert("RGB")).min(axis=-1) >= 240).mean())
    return found


def seconds(scene: Path, folder: Path, repeats: int, *, compact: bool) -> tuple[float, float, float]:
    """Run a scene as a command; return the processor seconds of film, page and all, of the fastest repeat."""
    found = []
    for _ in range(repeats):
        command = [sys.executable, __file__, "--child", str(scene), str(folder), str(int(compact))]
        before = os.times()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        after = os.times()
        if done.returncode:
            raise InputError(done.stderr.strip().splitlines()[-1])
        spent = json.loads(done.stdout.splitlines()[-1])
        found.append((spent["film"], spent["page"], sum(after[2:4]) - sum(before[2:4])))
    return min(found, key=lambda each: each[2])


def child(scene: str, folder: str, compact: str) -> None:
    """Run a scene in this process as the program does; print the processor seconds of film and page, imports among them."""
    from warpflat.app.cli.run import start_warp_silently
    from warpflat.app.scene.cuts import scene_with
    from warpflat.pattern.files.beside import work_beside

    spent, inside = {"film": 0.0, "page": 0.0}, []

    def count(owner: Any, name: str, part: str) -> None:
        function = getattr(owner, name)

        def counted(*args: Any, **options: Any) -> Any:
            if inside:
                return function(*args, **options)
            inside.append(part)
            begun = time.thread_time()
            try:
                return function(*args, **options)
            finally:
                spent[inside.pop()] += time.thread_time() - begun

        setattr(owner, name, counted)

    start_warp_silently()
    loaded = warpflat.load_scene(scene)
    if compact == "1":
        loaded = scene_with(
            loaded, output={**loaded.settings.output.model_dump(exclude_unset=True), "compact_film": True}
        )
    frames = importlib.import_module("warpflat.app.scene.frames")
    page = importlib.import_module("warpflat.app.review.page")
    for owner, names, part in (
        (frames.Film, ("__enter__", "__exit__"), "film"),
        (frames.FrameRecorder, ("__call__", "record_result", "record_cut_line"), "film"),
        (page, ("pack_frames", "pack_pictures", "write_review"), "page"),
    ):
        for name in names:
            count(owner, name, part)
    with work_beside():
        warpflat.run_scene(loaded, Path(folder))
    print(json.dumps(spent))


def main() -> None:
    """Print a row per scene."""
    if sys.argv[1:2] == ["--child"]:
        child(*sys.argv[2:5])
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "scenes", nargs="*", type=Path, default=sorted(set(SCENES.glob("*.toml")) - set(SCENES.glob("batch_*.toml")))
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--figures", action="store_true", help="run each scene once")
    parser.add_argument("--compact", action="store_true", help="with `compact_film`")
    given = parser.parse_args()
    print(
        f"{'scene':20}{'frames':>7}{'largest share':>15}{'MB':>6}{'page MB':>8}{'other':>6}{'share':>7}"
        f"{'film s':>8}{'page s':>8}{'run s':>7}{'share':>7}  stages; white"
    )
    for path in given.scenes:
        try:
            with tempfile.TemporaryDirectory() as scratch:
                folder = Path(scratch) / path.stem
                film_s, page_s, run_s = seconds(
                    path, folder, 1 if given.figures else given.repeats, compact=given.compact
                )
                film = folder / "frames.usdc"
                frames, counts, share = largest_shares(film)
                white = [f"{name} {100 * share:.0f} %" for name, share in white_shares(folder).items()]
                sizes = {file.name: file.stat().st_size / 1e6 for file in folder.iterdir()}
                size, page = sizes.pop("frames.usdc"), sizes.pop("review.html")
                other = sum(sizes.values())
                added = (size + page) / (size + page + other)
        except InputError as error:
            print(f"{path.stem:20}{error}")
            continue
        print(
            f"{path.stem:20}{frames:7}{100 * share:14.2f}%{size:6.1f}{page:8.2f}{other:6.1f}{100 * added:6.0f}%"
            f"{film_s:8.2f}{page_s:8.2f}{run_s:7.2f}{100 * (film_s + page_s) / run_s:6.0f}%  {' + '.join(map(str, counts))}"
            f"; {', '.join(white)}",
            flush=True,
        )


if __name__ == "__main__":
    main()
