"""Work and time of relaxations in the library's fabrics, soft in shear as cloth is: dome and bodice, and the pieces of forms.

    OMP_NUM_THREADS=1 python benchmarks/cloths.py [--fabrics woven] [--kinds grid crack irregular] [--sizes 2500 10000]
    OMP_NUM_THREADS=1 python benchmarks/cloths.py --kinds --forms princess_dress dress basic_block [--edge 10]
    OMP_NUM_THREADS=1 python benchmarks/cloths.py --real [--fabrics woven denim] [--limit 3]

Work units, and milliseconds from the start of `flatten`, until the energy is within 1 % and within 0.1 % of where it ends, and until it
has come to rest. There is no peer here: they take isotropic cloth. `--real`: every fabric of the library, or those named, on the shirt
front and the raw bodice of WARPFLAT_DATA, in processor seconds, start and all, and which take longer than the limit.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import warp as wp
from meshes import KINDS, Mesh, real_meshes

import warpflat
from warpflat.fabric.fabric import Fabric
from warpflat.fabric.library import find_fabric, load_library
from warpflat.flattening.progress import Progress
from warpflat.mannequin.forms import form_names
from warpflat.mannequin.mannequin import Mannequin


def meshes_of(chosen: argparse.Namespace) -> Iterator[Mesh]:
    """Those that are asked for."""
    for kind in chosen.kinds:
        for shape in chosen.shapes:
            for size in chosen.sizes:
                yield KINDS[kind](shape, size)
    if chosen.forms:
        mannequin = Mannequin.from_size("EU 38", resolution_mm=chosen.edge)
        for form in chosen.forms:
            for name, piece in mannequin.form(form).pieces.items():
                datum = piece.surface.lines[piece.datum] if piece.datum else None
                yield Mesh(name=f"{form}, {name}", surface=piece.surface, datum=datum)


def measure(mesh: Mesh, fabric: Fabric, repeats: int) -> str:
    """A line; the fastest of several."""
    best = ""
    least = float("inf")
    for _ in range(repeats):
        looks: list[tuple[float, float, float]] = []
        # As if read anew each time.
        surface = replace(mesh.surface, faces=mesh.surface.faces.copy())
        begun = time.perf_counter()

        def look(at: Progress, begun: float = begun, looks: list[tuple[float, float, float]] = looks) -> None:
            looks.append((at.model_energy_j, at.work_units, time.perf_counter() - begun))

        piece = warpflat.flatten(surface, fabric=fabric, datum=mesh.datum, device="cpu", callback=look)
        seconds, last = time.perf_counter() - begun, piece.stages[-1]
        energy = last.model_energy_j
        looks.append((energy, last.work_units, seconds))
        if seconds < least:
            least = seconds
            near = [next(each[1:] for each in looks if each[0] <= share * energy) for share in (1.01, 1.001)]
            columns = [f"{units:7.0f} {1e3 * taken:8.1f}" for units, taken in (*near, (last.work_units, seconds))]
            ended = "" if piece.converged else "  not at rest"
            best = f"{' '.join(columns)}   {energy:11.5g}  {piece.flipped_faces:5d}{ended}"
    return best


def measure_real(names: Sequence[str], limit: float) -> None:
    """Print a table of fabrics on real meshes, in processor seconds."""
    meshes = real_meshes()
    print(f"{'fabric':15} {'K/G':>6} " + " ".join(f"{mesh.name:>39}" for mesh in meshes))
    print(f"{'':22} " + " ".join(f"{'seconds':>8} {'units':>7} {'mJ':>10} {'flips':>5}  rest" for _ in meshes))
    slow, count = [], 0
    for name in names:
        fabric, row = find_fabric(name), []
        for mesh in meshes:
            surface = replace(mesh.surface, faces=mesh.surface.faces.copy(), of_faces={})
            begun = time.process_time()
            piece = warpflat.flatten(surface, fabric=fabric, device="cpu")
            seconds, last = time.process_time() - begun, piece.stages[-1]
            rest = "yes" if piece.converged else "NO"
            units = sum(stage.work_units for stage in piece.stages)
            row.append(
                f"{seconds:8.2f} {units:7.0f} {1e3 * last.model_energy_j:10.4g} {piece.flipped_faces:5d} {rest:>5}"
            )
            count += 1
            if seconds > limit or not piece.converged or piece.flipped_faces:
                slow.append(f"{name} on {mesh.name} ({seconds:.1f} s, {rest})")
        print(f"{name:15} {fabric.softness:6.0f} {' '.join(row)}", flush=True)
    print(f"{count - len(slow)} of {count} at rest within {limit:g} s; not: {'; '.join(slow) or 'none'}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabrics", nargs="+", help="of the library; woven, or all of them with --real")
    parser.add_argument("--real", action="store_true", help="the meshes of WARPFLAT_DATA alone")
    parser.add_argument("--limit", type=float, default=3.0, metavar="SECONDS", help="with --real: longest time allowed")
    parser.add_argument("--kinds", nargs="*", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--shapes", nargs="+", choices=["dome", "bodice"], default=["dome", "bodice"])
    parser.add_argument("--sizes", type=int, nargs="+", default=[2_500, 10_000], metavar="VERTICES")
    parser.add_argument(
        "--forms", nargs="*", choices=form_names(), default=[], metavar="FORM", help=", ".join(form_names())
    )
    parser.add_argument("--edge", type=float, default=10.0, metavar="MM", help="length of the mannequin's edges")
    parser.add_argument("--repeats", type=int, default=3, help="the fastest counts")
    chosen = parser.parse_args()
    wp.config.quiet = True
    if chosen.real:
        measure_real(chosen.fabrics or list(load_library()), chosen.limit)
        return
    for name in chosen.fabrics or ["woven"]:
        fabric = find_fabric(name)
        print(f"{name}, K/G {fabric.softness:.0f}")
        print(
            f"{'':42s} {'1 %':>7s} {'ms':>8s} {'0.1 %':>7s} {'ms':>8s} {'rest':>7s} {'ms':>8s}   {'energy J':>11s}  flips"
        )
        for mesh in meshes_of(chosen):
            count = f"{mesh.name}, {len(mesh.surface.vertices):,}"
            print(f"{count:42s} {measure(mesh, fabric, chosen.repeats)}", flush=True)


if __name__ == "__main__":
    main()
