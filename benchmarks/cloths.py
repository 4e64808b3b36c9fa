"""Work and time of relaxations in the library's fabrics, soft in shear as cloth is: dome and bodice, and the pieces of forms.

    OMP_NUM_THREADS=1 python benchmarks/cloths.py [--fabrics woven] [--kinds grid crack irregular] [--sizes 2500 10000]
    OMP_NUM_THREADS=1 python benchmarks/cloths.py --kinds --forms princess_dress dress basic_block [--edge 10]
    OMP_NUM_THREADS=1 python benchmarks/cloths.py --real [--fabrics woven denim] [--limit 3]
    python benchmarks/cloths.py --strain [--fabrics woven denim]

Work units, and milliseconds from the start of `flatten`, until the energy is within 1 % and within 0.1 % of where it ends, and until it
has come to rest. There is no peer here: they take isotropic cloth. `--real`: every fabric of the library, or those named, on the shirt
front and the raw bodice of WARPFLAT_DATA, in processor seconds, start and all, and which take longer than the limit. `--strain`: the
stiffnesses that an irregular mesh of 900 triangles and a grid of quads have against uniform strain along warp, along weft and in shear, by
the energy that they store [N/m], beside the fabric's. Of grains of 0 to 80 degrees on triangles the farthest from the fabric is printed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from meshes import KINDS, Mesh, real_meshes
from scipy.spatial import Delaunay

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.fabric.library import find_fabric, load_library
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.model.membrane import plane_stress
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.mannequin.forms import form_names
from warpflat.garment.mannequin.mannequin import Mannequin

STRAIN = 1e-5


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


def softness(fabric: Fabric) -> float:
    """Return K/G, the tensile stiffness along the stiffer threads over the shear stiffness."""
    return max(fabric.stiffness_warp, fabric.stiffness_weft) / fabric.shear_stiffness


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
        print(f"{name:15} {softness(fabric):6.0f} {' '.join(row)}", flush=True)
    print(f"{count - len(slow)} of {count} at rest within {limit:g} s; not: {'; '.join(slow) or 'none'}")


def stored_stiffness(surface: Surface, fabric: Fabric, grain_angle: float) -> FloatArray:
    """Against strain along warp, along weft, and in shear, each alone, from the energies of a plane [N/m]."""
    flat, axes = surface.vertices[:, :2], np.column_stack(grain_axes(grain_angle))
    network = SpringNetwork.build(surface, fabric, flat, grain_angle=grain_angle, device="cpu")
    state, area, found = Relaxation(network, RelaxOptions(), start=flat), float(network.cell_arrays.area.sum()), []
    for strain in STRAIN * np.array([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]], [[0.0, 0.5], [0.5, 0.0]]]):
        state.place(flat @ np.linalg.inv(np.eye(2) + axes @ strain @ axes.T))
        found.append(2.0 * state.energies().potential / area / STRAIN**2)
    return np.array(found)


def measure_strain(names: Sequence[str]) -> None:
    """Print a table of what meshes store under uniform strain."""
    points = np.random.default_rng(7).uniform(-0.2, 0.2, (470, 2)) @ [[1.0, 0.3], [0.0, 1.0]]
    irregular = warpflat.make_surface(np.column_stack([points, np.zeros(len(points))]), Delaunay(points).simplices)
    x, y = np.meshgrid(np.linspace(0.0, 0.3, 31), np.linspace(0.0, 0.36, 31))
    number = np.arange(x.size).reshape(x.shape)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    grid = warpflat.make_surface(np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3), quads)
    titles = (
        f"{len(irregular.faces)} triangles",
        "the fabric, by its curves",
        f"{len(quads)} quads",
        "the fabric, secants",
    )
    print(f"{'':12} {' '.join(f'{title:>26}' for title in titles)}  triangles off by")
    for name in names:
        fabric = find_fabric(name)
        c_warp, c_weft, _ = plane_stress(fabric)
        secants = np.array([fabric.stiffness_warp, fabric.stiffness_weft, fabric.shear_stiffness])
        # Under small strain, which a curve may resist by more or less than its secant.
        own = [float(fabric.tension(STRAIN, thread)) / STRAIN for thread in ("warp", "weft")]  # type: ignore[arg-type]
        curves = np.array([c_warp, c_weft, secants[2]]) + np.array([*own, secants[2]]) - secants
        each = [stored_stiffness(irregular, fabric, angle) for angle in (0.0, 20.0, 45.0, 60.0, 80.0)]
        farthest = max(each, key=lambda found: float(np.abs(found / curves - 1.0).max()))
        rows = (farthest, curves, stored_stiffness(grid, fabric, 0.0), secants)
        columns = [" ".join(f"{value:8.5g}" for value in row) for row in rows]
        print(f"{name:12} {' '.join(columns)}  {100 * np.abs(farthest / curves - 1.0).max():.4f} %")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabrics", nargs="+", help="of the library; woven, or all of them with --real")
    parser.add_argument("--strain", action="store_true", help="stiffnesses stored under uniform strain")
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
    if chosen.strain:
        measure_strain(chosen.fabrics or ["woven", "denim", "interlock", "power-net", "isotropic"])
        return
    if chosen.real:
        measure_real(chosen.fabrics or list(load_library()), chosen.limit)
        return
    for name in chosen.fabrics or ["woven"]:
        fabric = find_fabric(name)
        print(f"{name}, K/G {softness(fabric):.0f}")
        print(
            f"{'':42s} {'1 %':>7s} {'ms':>8s} {'0.1 %':>7s} {'ms':>8s} {'rest':>7s} {'ms':>8s}   {'energy J':>11s}  flips"
        )
        for mesh in meshes_of(chosen):
            count = f"{mesh.name}, {len(mesh.surface.vertices):,}"
            print(f"{count:42s} {measure(mesh, fabric, chosen.repeats)}", flush=True)


if __name__ == "__main__":
    main()
