"""Whole garments: what is found in them, how they are cut, and how flat their pieces lie.

python benchmarks/garments.py [FILES or FOLDER ...] [--fabric woven] [--command]

Default: $WARPFLAT_DATA/garments. A file in another unit than metres is given as FILE:SCALE, as suit.obj:0.1; a file whose size is
that of a person in decimetres, centimetres or millimetres is scaled by itself.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import warpflat
from warpflat.garment.sew_pieces import meeting_borders
from warpflat.seams.find import FoundSeams
from warpflat.surface.io.read import SUFFIXES
from warpflat.surface.mesh import Surface


def read(path: str) -> list[Surface]:
    """Read the layers of a garment, in metres."""
    name, _, scale = path.partition(":")
    layers = list(warpflat.read_layers(name, units="m"))
    size = max(float(np.ptp(layer.vertices, axis=0).max()) for layer in layers)
    factor = float(scale) if scale else next((s for s in (1.0, 0.1, 0.01, 0.001) if size * s < 2.5), 1.0)
    return [
        warpflat.make_surface(factor * layer.vertices, layer.faces, name=layer.name, closed=True) for layer in layers
    ]


def left_and_right_apart(found: FoundSeams) -> float:
    """Return how much the lengths of left and right seams of one name differ, at most [mm]."""
    length = {seam.name: seam.length for seam in found.seams}
    pairs = [(one, one.replace("left", "right")) for one in length if "left" in one]
    return 1e3 * max((abs(length[one] - length[other]) for one, other in pairs if other in length), default=0.0)


def measure(path: str, fabric: str) -> list[str]:
    """Return a row of the table."""
    begun = time.perf_counter()
    layers = read(path)
    plain = warpflat.find_seams(layers)
    found_at = time.perf_counter()
    darted = warpflat.find_seams(layers, fabric=fabric)
    cells = []
    sewn_apart = 0.0
    for found in (plain, darted):
        surfaces = [warpflat.open_tube(p) if _is_tube(p) else p for p in found.pieces]
        pieces = [
            warpflat.flatten(piece, fabric=fabric, datum="grain" if "grain" in piece.lines else None)
            for piece in surfaces
        ]
        sewn = warpflat.sew_pieces(pieces)
        if sewn is not None:
            sewn_apart = max(abs(1e3 * (seam.lengths[0] - seam.lengths[1])) for seam in sewn.seams)
            pieces = list(sewn.pieces)
        area = np.array([float(piece.fit.area.sum()) for piece in pieces])
        outside = np.array([piece.fit.outside for piece in pieces])
        energy = sum(piece.layout_measures["strain_energy_j"] for piece in pieces)
        cells += [f"{energy:.2f}", f"{100 * float((outside * area).sum() / area.sum()):.1f}"]
    pairs = meeting_borders({piece.name: piece for piece in darted.pieces})
    by_name = {piece.name: piece for piece in darted.pieces}
    length = sum(
        float(np.linalg.norm(np.diff(by_name[pair.pieces[0]].vertices[pair.vertices[0]], axis=0), axis=1).sum())
        for pair in pairs
    )
    return [
        Path(path.partition(":")[0]).stem[:22],
        darted.what[:34],
        str(len(darted.pieces)),
        f"{length / np.sqrt(area.sum()):.1f}",
        *cells,
        f"{left_and_right_apart(darted):.1f}",
        f"{sewn_apart:.2f}",
        f"{found_at - begun:.1f}",
        f"{time.perf_counter() - found_at:.1f}",
    ]


def _is_tube(surface: Surface) -> bool:
    from warpflat.surface.tubes import tube_borders

    return bool(tube_borders(surface))


def whole_command(path: str, fabric: str) -> str:
    """Return the seconds of the whole command, with pictures and film, and its exit code."""
    import subprocess

    layers = read(path)
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "garment.obj"
        lines, count = [], 0
        for layer in layers:
            lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in layer.vertices.tolist()]
            lines += ["f " + " ".join(str(v + 1 + count) for v in face if v >= 0) for face in layer.faces.tolist()]
            count += len(layer.vertices)
        mesh.write_text("\n".join(lines) + "\n", encoding="utf-8")
        begun = time.perf_counter()
        command = [sys.executable, "-m", "warpflat", "flatten", str(mesh), "--units", "m", "--fabric", fabric]
        done = subprocess.run(
            [*command, "--seams", "auto", "--quiet", "--out", f"{folder}/out"], capture_output=True, check=False
        )
        return f"{time.perf_counter() - begun:.1f} ({done.returncode})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", default=[f"{os.environ.get('WARPFLAT_DATA', '.')}/garments"])
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--command", action="store_true", help="time the whole command, too")
    options = parser.parse_args()
    files = [
        str(file)
        for path in options.paths
        for file in (sorted(Path(path).iterdir()) if Path(path).is_dir() else [path])
        if Path(str(file).partition(":")[0]).suffix.lower() in SUFFIXES and "avatar" not in str(file)
    ]
    heads = (
        "garment|what|pieces|seam/sqrt(A)|parted J|beyond %|with darts J|beyond %|left-right mm|sides mm|s found|s rest"
    )
    print(" | ".join(heads.split("|")) + (" | command s (rc)" if options.command else ""), flush=True)
    for file in files:
        try:
            row = measure(file, options.fabric)
        except warpflat.InputError as error:
            row = [Path(file).stem, f"refused: {error}"]
        if options.command:
            row.append(whole_command(file, options.fabric))
        print(" | ".join(row), flush=True)


if __name__ == "__main__":
    main()
