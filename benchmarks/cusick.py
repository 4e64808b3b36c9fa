"""Cusick's drape test: a disc of 300 mm hangs over a support of 180 mm; the share of its free ring that its shadow covers.

    python benchmarks/cusick.py [--fabrics silk cotton wool-plain denim trousers] [--edge 8] [--max-steps 20000]

The support is a horizontal disc; on it the cloth is held, as between the two plates of the tester. The start is the flat disc
with a ripple of a tenth of a millimetre, so that no direction is preferred. Nodes are the maxima of the shadow's radius.
"""

from __future__ import annotations

import argparse

import numpy as np
import warp as wp
from scipy.spatial import Delaunay

import warpflat
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import SewnCloth

RADIUS, SUPPORT = 0.15, 0.09


def disc(fabric: warpflat.Fabric, edge: float) -> SewnCloth:
    """A disc in rings, the support's edge among them."""
    radii = np.concatenate(
        [
            np.linspace(0.0, SUPPORT, round(SUPPORT / edge) + 1),
            np.linspace(SUPPORT, RADIUS, round((RADIUS - SUPPORT) / edge) + 1)[1:],
        ]
    )
    rows = []
    for number, radius in enumerate(radii):
        count = max(1, round(2.0 * np.pi * radius / edge))
        angle = 2.0 * np.pi * (np.arange(count) + 0.5 * (number % 2)) / count
        rows.append(radius * np.column_stack([np.sin(angle), np.cos(angle)]))
    flat = np.concatenate(rows)
    triangles = Delaunay(flat).simplices
    corner = flat[triangles]
    area = np.linalg.det(corner[:, 1:] - corner[:, :1])
    triangles[area < 0.0] = triangles[area < 0.0][:, ::-1]
    triangles = triangles[np.abs(area) > 1e-3 * edge**2]
    faces = np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int32)
    ripple = 1e-4 * np.random.default_rng(1).standard_normal(len(flat))
    space = np.column_stack([flat[:, 0], np.where(np.hypot(*flat.T) > SUPPORT + 1e-6, ripple, 0.0), -flat[:, 1]])
    count = len(faces)
    return SewnCloth(
        fabric=fabric, designed=space, faces=faces, flat_faces=faces, flat=flat, welded=np.arange(len(flat), dtype=np.int32),
        warp=np.tile([0.0, 1.0], (count, 1)), weft=np.tile([1.0, 0.0], (count, 1)), piece_faces={"disc": slice(0, count)},
        piece_vertices={"disc": slice(0, len(flat))}, lines={},
    )  # fmt: skip


def shadow(cloth: SewnCloth, places: np.ndarray) -> tuple[float, int]:
    """Return the drape coefficient, and the number of nodes."""
    import shapely

    triangles = places[cloth.faces[:, :3]][:, :, [0, 2]]
    area = shapely.union_all(shapely.buffer(shapely.polygons(triangles), 1e-7)).area
    inner, outer = np.pi * SUPPORT**2, np.pi * RADIUS**2
    rim = np.hypot(*cloth.flat.T) > RADIUS - 1e-6
    angle = np.arctan2(*places[rim][:, [0, 2]].T)
    radius = np.hypot(*places[rim][:, [0, 2]].T)[np.argsort(angle)]
    share = np.abs(np.fft.rfft(radius - radius.mean()))[:20]
    return float((area - inner) / (outer - inner)), int(share[1:].argmax() + 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fabrics", nargs="+", default=["silk", "cotton", "wool-plain", "denim", "trousers"])
    parser.add_argument("--edge", type=float, default=8.0, help="of the mesh [mm]")
    parser.add_argument("--max-steps", type=int, default=20_000)
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    print(f"{'fabric':<12} {'g/m2':>5} {'uN m':>6} {'N/m':>6} {'c mm':>5}  {'drape %':>7} {'nodes':>5}  at rest")
    for name in given.fabrics:
        fabric = warpflat.find_fabric(name)
        cloth = disc(fabric, 1e-3 * given.edge)
        held = np.hypot(*cloth.flat.T) < SUPPORT + 1e-6
        worn = relax_drape(cloth, None, held=held, options=warpflat.DrapeOptions(max_steps=given.max_steps))
        coefficient, nodes = shadow(cloth, worn.positions)
        length = (fabric.bending / (9.80665 * fabric.areal_density)) ** (1 / 3)
        print(
            f"{fabric.name:<12} {1e3 * fabric.areal_density:5.0f} {1e6 * fabric.bending:6.1f} {fabric.shear_stiffness:6.1f} "
            f"{1e3 * length:5.1f}  {100 * coefficient:7.1f} {nodes:5d}  {'yes' if worn.converged else 'NO'} "
            f"({worn.steps} steps, {100 * worn.residual:.2f} %)", flush=True
        )  # fmt: skip


if __name__ == "__main__":
    main()
