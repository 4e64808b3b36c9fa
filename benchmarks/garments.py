"""Whole garments: what is found in them, how they are cut, how flat their pieces lie, and how near to the mesh they sew up.

python benchmarks/garments.py [FILES or FOLDER ...] [--fabric woven] [--most-pieces N] [--limit SHARE] [--quick]

Default: $WARPFLAT_DATA/garments. A file in another unit than metres is given as FILE:SCALE, as suit.obj:0.1; a file whose size is
that of a person in decimetres, centimetres or millimetres is scaled by itself.

Columns: strain energy [J] and share beyond the limit [%] before (in one piece, `--seams none`, at most a minute), parted where every
garment of its kind is, and with darts and further seams, the last two sewn; strains along warp and weft at 5 and 95 % of the cloth, shear
at 95 %; left and right seams apart; both sides of seams apart; seconds of the whole command with its exit code; distance of the sewn cloth
from the mesh, draped over it (mean, 95 %).
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from itertools import zip_longest
from pathlib import Path

import numpy as np

import warpflat
from warpflat.core.sums import weighted_percentiles
from warpflat.flat.surface.io.read import SUFFIXES
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.tubes import tube_borders
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.sew_pieces import meeting_borders
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import sew_cloth
from warpflat.garment.seams.find import FoundSeams

# Seconds for a garment in one piece.
_BEFORE = 60
# The cloth is draped with little weight, so that what shows is its cut, and until little moves.
_DRAPE = DrapeOptions(gravity=1.0, tolerance=0.02, max_steps=1000)


def read(path: str) -> list[Surface]:
    """Read the layers of a garment, in metres."""
    name, _, scale = path.partition(":")
    layers = list(warpflat.read_layers(name, units="m"))
    size = max(float(np.ptp(layer.vertices, axis=0).max()) for layer in layers)
    factor = float(scale) if scale else next((s for s in (1.0, 0.1, 0.01, 0.001) if size * s < 2.5), 1.0)
    return [
        warpflat.make_surface(factor * layer.vertices, layer.faces, name=layer.name, closed=True) for layer in layers
    ]


def write(layers: list[Surface], path: Path) -> None:
    """Write layers as one OBJ [m]."""
    lines, count = [], 0
    for layer in layers:
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in layer.vertices.tolist()]
        lines += ["f " + " ".join(str(v + 1 + count) for v in face if v >= 0) for face in layer.faces.tolist()]
        count += len(layer.vertices)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def before(layers: list[Surface], fabric: str) -> list[str]:
    """Return energy and share beyond the limit of the largest layer, laid flat in one piece."""
    import json

    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "garment.obj"
        write(layers[:1], mesh)
        command = [sys.executable, "-m", "warpflat", "flatten", str(mesh), "--units", "m", "--fabric", fabric]
        command += [
            "--seams",
            "none",
            "--no-picture",
            "--frames",
            "0",
            "--gap",
            "0",
            "--quiet",
            "--out",
            f"{folder}/out",
        ]
        try:
            subprocess.run(command, capture_output=True, check=False, timeout=_BEFORE)
            piece = next(iter(json.loads((Path(folder) / "out" / "metrics.json").read_text())["pieces"].values()))
        except subprocess.TimeoutExpired:
            return [f"> {_BEFORE} s", ""]
        except OSError:
            return ["refused", ""]
    return [f"{piece['strain_energy_j']:.2f}", f"{100 * piece['wear']['outside']:.1f}"]


def sewn(found: FoundSeams, fabric: str) -> Garment:
    """Return the pieces, flattened and sewn as the command does it."""
    surfaces = [warpflat.open_tube(piece) if tube_borders(piece) else piece for piece in found.pieces]
    grain = ["grain" if "grain" in piece.lines else None for piece in surfaces]
    pieces = [warpflat.flatten(piece, fabric=fabric, datum=datum) for piece, datum in zip(surfaces, grain, strict=True)]
    return warpflat.sew_pieces(pieces, eased=True)


def strain(garment: Garment) -> list[str]:
    """Return energy and share beyond the limit."""
    pieces = list(garment.pieces.values())
    area = np.array([float(piece.fit.area.sum()) for piece in pieces])
    outside = np.array([piece.fit.outside for piece in pieces])
    energy = sum(piece.layout_measures["strain_energy_j"] for piece in pieces)
    return [f"{energy:.2f}", f"{100 * float((outside * area).sum() / area.sum()):.2f}"]


def strains(garment: Garment) -> list[str]:
    """Return the strains along warp and along weft at 5 and 95 % of the cloth [%], and the shear at 95 % [degrees]."""
    fits = [piece.fit for piece in garment.pieces.values()]
    area = np.concatenate([fit.area for fit in fits])

    def at(name: str, *shares: float) -> list[float]:
        return weighted_percentiles(
            np.concatenate([np.abs(getattr(fit, name)) if name == "shear" else getattr(fit, name) for fit in fits]),
            area,
            shares,
        )

    warp, weft = (
        "{:+.1f} to {:+.1f}".format(*(100.0 * value for value in at(name, 0.05, 0.95)))
        for name in ("strain_warp", "strain_weft")
    )
    return [warp, weft, f"{at('shear', 0.95)[0]:.1f}"]


def left_and_right_apart(found: FoundSeams) -> float:
    """Return how much the lengths of left and right seams of one name differ in a layer, at most [mm]; a missing one has none."""
    lengths: dict[str, list[float]] = {}
    for seam in found.seams:
        lengths.setdefault(seam.name, []).append(1e3 * seam.length)
    lefts = {re.sub(r"\bright\b", "left", name) for name in lengths}
    pairs = [(name, re.sub(r"\bleft\b", "right", name)) for name in lefts if re.search(r"\bleft\b", name)]
    # Layers come one after the other, and so do their seams.
    both = (zip_longest(lengths.get(one, []), lengths.get(other, []), fillvalue=0.0) for one, other in pairs)
    return max((abs(left - right) for pair in both for left, right in pair), default=0.0)


def draped(garment: Garment, layers: list[Surface]) -> str:
    """Return the distance of the sewn cloth at rest over the mesh that was given, mean and 95 % [mm]."""
    cloth = sew_cloth(garment)
    begin = np.cumsum([0, *(len(layer.vertices) for layer in layers)])
    faces = [np.where(layer.faces >= 0, layer.faces + first, -1) for layer, first in zip(layers, begin, strict=False)]
    body = Body(
        np.concatenate([layer.vertices for layer in layers]), np.concatenate(faces).astype(np.int32), device="cpu"
    )
    worn = relax_drape(cloth, body, options=_DRAPE)
    away = 1e3 * np.abs(body.gaps(worn.positions))
    return "fell off" if worn.fell_off else f"{away.mean():.1f}, {np.quantile(away, 0.95):.1f}"


def whole_command(layers: list[Surface], fabric: str) -> str:
    """Return the seconds of the whole command, with pictures and film, and its exit code."""
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "garment.obj"
        write(layers, mesh)
        command = [sys.executable, "-m", "warpflat", "flatten", str(mesh), "--units", "m", "--fabric", fabric]
        command += ["--seams", "auto", "--quiet", "--out", f"{folder}/out"]
        begun = time.perf_counter()
        done = subprocess.run(command, capture_output=True, check=False)
        return f"{time.perf_counter() - begun:.1f} ({done.returncode})"


def measure(path: str, fabric: str, wanted: warpflat.SeamOptions, *, quick: bool) -> list[str]:
    """Return a row of the table."""
    layers = read(path)
    parted = warpflat.find_seams(layers)
    plain = sewn(parted, fabric)
    found = warpflat.find_seams(layers, wanted, fabric=fabric)
    garment = sewn(found, fabric)
    by_name = {piece.name: piece.vertices for piece in found.pieces}
    pairs = meeting_borders({piece.name: piece for piece in found.pieces})
    lines = [by_name[pair.pieces[0]][pair.vertices[0]] for pair in pairs]
    length = sum(float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in lines)
    area = sum(float(piece.fit.area.sum()) for piece in garment.pieces.values())
    return [
        Path(path.partition(":")[0]).stem[:22],
        found.what[:34],
        str(sum(len(layer.faces) for layer in layers)),
        str(len(found.pieces)),
        str(sum(seam.name.startswith("dart") for seam in found.seams)),
        f"{length / np.sqrt(area):.1f}",
        *(["", ""] if quick else before(layers, fabric)),
        *strain(plain),
        *strain(garment),
        *strains(garment),
        f"{max(map(left_and_right_apart, (parted, found))):.1f}",
        f"{max((1e3 * abs(seam.lengths[0] - seam.lengths[1]) for seam in garment.seams), default=0.0):.2f}",
        *(["", ""] if quick else [whole_command(layers, fabric), draped(garment, layers)]),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", default=[f"{os.environ.get('WARPFLAT_DATA', '.')}/garments"])
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--most-pieces", type=int, help="of each layer, as the command takes it")
    parser.add_argument("--limit", type=float, default=warpflat.SeamOptions.limit, help="as the command takes it")
    parser.add_argument("--quick", action="store_true", help="no single piece, no whole command and no drape")
    options = parser.parse_args()
    wanted = warpflat.SeamOptions(most_pieces=options.most_pieces, limit=options.limit)
    files = [
        str(file)
        for path in options.paths
        for file in (sorted(Path(path).iterdir()) if Path(path).is_dir() else [path])
        if Path(str(file).partition(":")[0]).suffix.lower() in SUFFIXES and "avatar" not in str(file)
    ]
    heads = (
        "garment|what|faces|pieces|darts|seam/sqrt(A)|before J|%|parted J|%|with darts J|%|warp %|weft %|shear deg|left-right mm|sides mm"
        "|command s (rc)|draped mm"
    )
    print(" | ".join(heads.split("|")), flush=True)
    for file in files:
        try:
            row = measure(file, options.fabric, wanted, quick=options.quick)
        except warpflat.InputError as error:
            row = [Path(file).stem, f"refused: {error}"]
        print(" | ".join(row), flush=True)


if __name__ == "__main__":
    main()
