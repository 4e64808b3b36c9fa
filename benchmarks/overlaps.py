"""Pieces that would lie over themselves: is a pattern drawn, and what does contact cost?

    OMP_NUM_THREADS=1 python benchmarks/overlaps.py [FILES] [--fabric isotropic] [--gap 0.5] [--model membrane] [--picture FOLDER]

Without files: a family of curled strips, spirals, horseshoes, slit disks and fronts with two legs, and `trouser_front.obj` of
WARPFLAT_DATA (or ../shared/data). Price: the model energy with contact less that without. Least gap: between border places that have the
whole gap between them, 25 mm or more along the border. Seconds are processor seconds.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp
from overlap_family import FAMILY
from real import default_files

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.flattening.progress import CONTACT
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.injective import border_edges_of, crack_edges_of
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.to_pattern import pattern_of_surface

_FAR = 0.025


def least_gap(surface: Surface, positions: FloatArray) -> float:
    """Return the least distance between border vertices and edges that are far along the border, cracks left out [m]."""
    edges, crack = border_edges_of(surface), crack_edges_of(surface)
    length = np.linalg.norm(surface.vertices[edges.head] - surface.vertices[edges.tail], axis=1)
    ends = np.concatenate([[0.0], np.cumsum(length)])
    station, around = ends[:-1] - ends[edges.first], ends[edges.first + edges.count] - ends[edges.first]
    a, b = positions[edges.tail], positions[edges.head]
    least = np.inf
    for v in np.flatnonzero(~crack):
        same = edges.first == edges.first[v]
        to_tail, to_head = np.abs(station - station[v]), np.abs(station + length - station[v])
        way = np.minimum.reduce([to_tail, around - to_tail, to_head, np.abs(around - to_head)])
        far = (~same | (way >= _FAR)) & ~crack & (edges.component == edges.component[v])
        edge, spoke = (b - a)[far], positions[edges.tail[v]] - a[far]
        t = np.clip((edge * spoke).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
        least = min(least, float(np.linalg.norm(spoke - t[:, None] * edge, axis=1).min(initial=np.inf)))
    return least


def is_drawn(piece: Flattening) -> bool:
    """Return whether a pattern can be drawn of a piece."""
    try:
        pattern_of_surface([piece], name="pattern")
    except InputError:
        return False
    return True


def measure(surface: Surface, chosen: argparse.Namespace) -> tuple[str, bool]:
    """Return a line, and whether all is as it should be."""
    options = RelaxOptions(gap_mm=chosen.gap)
    begun = time.process_time()
    piece = warpflat.flatten(
        replace(surface, faces=surface.faces.copy()),
        fabric=chosen.fabric,
        model=chosen.model,
        relax=options,
        device="cpu",
    )
    seconds = time.process_time() - begun
    if chosen.picture:
        chosen.picture.mkdir(parents=True, exist_ok=True)
        warpflat.save_piece(piece, chosen.picture / surface.name, frames=False)
    contact, before = piece.stages[-1], piece.stages[-2]
    if contact.name != CONTACT:
        before = contact
    share = piece.contact_energy / before.model_energy_j if before.model_energy_j else np.inf
    good = is_drawn(piece) and not piece.overlap and not piece.flipped_faces and piece.converged
    return (
        f"{len(surface.vertices):6,} {'yes' if is_drawn(piece) else 'NO':>5} {1e6 * piece.overlap:9.3g} {piece.flipped_faces:5d} "
        f"{1e3 * before.model_energy_j:10.4g} {1e3 * piece.contact_energy:10.4g} {100 * share:9.3g} "
        f"{1e3 * least_gap(piece.network.surface, piece.positions):8.3f} {seconds:8.2f}  {contact.name}"
        f"{'' if piece.converged else ', not at rest'}"
    ), good


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILES")
    parser.add_argument("--units", default="m", help="of files that carry none")
    parser.add_argument("--fabric", default="isotropic")
    parser.add_argument("--model", choices=["auto", "springs", "membrane"], default="auto")
    parser.add_argument("--gap", type=float, default=0.5, metavar="MM")
    parser.add_argument("--picture", type=Path, metavar="FOLDER", help="also draw each piece")
    chosen = parser.parse_args()
    wp.config.quiet = True
    files = [Path(file) for file in chosen.files] or [f for f in default_files() if f.stem == "trouser_front"]
    made = {} if chosen.files else {name: make() for name, make in FAMILY.items()}
    meshes = made | {file.stem: read_surface(file, units=chosen.units) for file in files}
    print(
        f"{'piece':30} {'verts':>6} {'drawn':>5} {'over mm2':>9} {'flips':>5} {'free mJ':>10} {'price mJ':>10} {'price %':>9} "
        f"{'gap mm':>8} {'seconds':>8}  last stage"
    )
    good = 0
    for name, surface in meshes.items():
        line, as_it_should = measure(replace(surface, name=name.replace(" ", "_").replace(",", "")), chosen)
        good += as_it_should
        print(f"{name[:30]:30} {line}", flush=True)
    print(f"{good} of {len(meshes)} drawn, at rest, without overlap and flips")


if __name__ == "__main__":
    main()
