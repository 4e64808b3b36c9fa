"""Figures of the films of scenes: how many frames, how much moves in one, and what film and review page add to a run.

    python benchmarks/film.py [SCENE.toml ...] [--repeats 2]

A row per scene. `frames` is their number, `stages` how many each stage has. `largest share` is the way of the vertex that moves
farthest in one frame, as a share of the largest displacement in its stage, over all pieces. `film` and `MB` are what `frames.usdc`
adds to the run: CPU seconds by the difference of the fastest runs with it and without it, and its size. `review` is the same of
`review.html`. `run` is the whole run with both. CPU seconds count, since they are the same on a busy machine.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import warpflat
from warpflat.core.errors import InputError
from warpflat.scene.load import Scene

SCENES = Path(__file__).parents[1] / "scenes"


def largest_shares(film: Path) -> tuple[int, list[int], float]:
    """Return the number of frames of a film, that of each stage, and the largest share of a stage's way in one frame."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(film))
    worst, counts, frames = 0.0, list[int](), 0
    for piece in stage.GetDefaultPrim().GetChildren():
        pattern = UsdGeom.Mesh(stage.GetPrimAtPath(f"{piece.GetPath()}/pattern"))
        if not pattern:
            continue
        times = pattern.GetPointsAttr().GetTimeSamples()
        number = piece.GetAttribute("warpflat:stage_number")
        still = pattern.GetFaceVertexIndicesAttr().GetTimeSamples()
        shots: dict[tuple[int, int], list[Any]] = {}
        for at in times:
            size = len(pattern.GetPointsAttr().Get(at))
            key = number.Get(at), size * 0 + sum(change <= at for change in still)
            shots.setdefault(key, []).append(np.array(pattern.GetPointsAttr().Get(at), dtype=np.float64))
        frames, counts = len(times), [len(shot) for shot in shots.values()]
        for shot in shots.values():
            way = max(np.linalg.norm(points - shot[0], axis=1).max() for points in shot)
            if way > 1e-6:
                moves = (np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(shot))
                worst = max(worst, *(move / way for move in moves))
    return frames, counts, worst


def timed(scene: Scene, folder: Path, repeats: int, **output: Any) -> float:
    """Return the seconds of the fastest run with these settings of its output."""
    settings = scene.settings.model_copy(update={"output": scene.settings.output.model_copy(update=output)})
    asked, best = replace(scene, settings=settings), np.inf
    for _ in range(repeats):
        begun = time.process_time()
        warpflat.run_scene(asked, folder)
        best = min(best, time.process_time() - begun)
    return float(best)


def main() -> None:
    """Print a row per scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "scenes", nargs="*", type=Path, default=sorted(set(SCENES.glob("*.toml")) - set(SCENES.glob("batch_*.toml")))
    )
    parser.add_argument("--repeats", type=int, default=2)
    given = parser.parse_args()
    print(
        f"{'scene':22}{'frames':>7}{'largest share':>15}{'film s':>8}{'MB':>6}{'page s':>8}{'MB':>6}{'run s':>7}  stages"
    )
    for path in given.scenes:
        scene = warpflat.load_scene(path)
        try:
            with tempfile.TemporaryDirectory() as folder:
                timed(scene, Path(folder) / "warm", 1)  # kernels and libraries are loaded
                bare = timed(scene, Path(folder) / "bare", given.repeats, frames=0, review=False)
                filmed = timed(scene, Path(folder) / "bare", given.repeats, review=False)
                whole = timed(scene, Path(folder) / "film", given.repeats)
                film = Path(folder) / "film" / "frames.usdc"
                frames, counts, share = largest_shares(film)
                size, page = film.stat().st_size / 1e6, film.with_name("review.html").stat().st_size / 1e6
        except InputError as error:
            print(f"{path.stem:22}{error}")
            continue
        print(
            f"{path.stem:22}{frames:7}{100 * share:14.2f}%{filmed - bare:8.2f}{size:6.1f}"
            f"{whole - filmed:8.2f}{page:6.2f}{whole:7.2f}  "
            f"{' + '.join(map(str, counts))}"
        )


if __name__ == "__main__":
    main()
