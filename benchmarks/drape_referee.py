"""A referee for the drape: the same bodice in NVIDIA Newton's Style3D solver, from the same start, on the same body.

    python benchmarks/drape_referee.py [--size "EU 38"] [--resolution 20] [--fabric woven] [--steps 400] [--compression 1]

Needs `newton==1.8.0` (Apache 2.0; extra `referee`). Both get the same sewn triangles, rest state, thread stiffnesses, weight, bending and
friction. Newton's steps are dynamic: the speeds are set to zero every 10 steps, and what still moves at the end is printed.
Its law is linear under compression. So ours is, too, here (`compression` 1), unless `--compression 0.1` asks for what `drape` has else.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

import warpflat
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.sewn_cloth import SewnCloth


def newton_drape(
    cloth: SewnCloth, body: Body | None, *, steps: int, friction: float = 0.3, held: np.ndarray | None = None,
    step_s: float = 1.0 / 600.0, iterations: int = 10,
) -> np.ndarray:  # fmt: skip
    """Let Newton's Style3D bring cloth to rest from its designed surface; return its places, #V by 3 [m]."""
    import newton
    from newton.solvers import style3d

    fabric = cloth.fabric
    faces, _ = triangulate(cloth.faces)
    panel, _ = triangulate(cloth.flat_faces)
    # Style3D's first axis is x of the panel, the weft.
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y)
    newton.solvers.SolverStyle3D.register_custom_attributes(builder)
    style3d.add_cloth_mesh(
        builder, pos=wp.vec3(0.0), rot=wp.quat_identity(), vel=wp.vec3(0.0), panel_verts=cloth.flat.tolist(),
        panel_indices=panel.ravel().tolist(), vertices=cloth.designed.tolist(), indices=faces.ravel().tolist(),
        density=fabric.areal_density, particle_radius=5e-4,
        tri_aniso_ke=wp.vec3(fabric.stiffness_weft, fabric.stiffness_warp, fabric.shear_stiffness),
        edge_aniso_ke=wp.vec3(fabric.bending),
    )  # fmt: skip
    for vertex in [] if held is None else np.flatnonzero(held):
        builder.particle_flags[vertex] &= ~newton.ParticleFlags.ACTIVE
    if body is not None:
        mesh: Any = newton.Mesh(
            body.vertices.astype(np.float32), body.triangles.ravel().astype(np.int32), compute_inertia=False
        )
        builder.add_shape_mesh(body=-1, mesh=mesh, cfg=newton.ModelBuilder.ShapeConfig(mu=friction))
    model = builder.finalize("cpu")
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = 1e3, 1e-5, friction
    solver = newton.solvers.SolverStyle3D(model, config=newton.solvers.SolverStyle3D.Config(iterations=iterations))
    pipeline = newton.CollisionPipeline(model, soft_contact_gap=0.01)
    contacts = pipeline.contacts()
    now, after, control = model.state(), model.state(), model.control()
    for number in range(steps):
        if body is not None:
            pipeline.collide(now, contacts)
        now.clear_forces()
        solver.step(now, after, control, contacts, step_s)
        now, after = after, now
        if number % 10 == 9 and number < 0.9 * steps:
            now.particle_qd.zero_()
    speed = np.linalg.norm(now.particle_qd.numpy(), axis=1)
    print(f"Newton {newton.__version__}: {steps} steps; speed at the end {1e3 * speed.mean():.2f} mm/s in the mean")
    return np.asarray(now.particle_q.numpy(), dtype=np.float64)


def show(name: str, drape: warpflat.Drape) -> None:
    measures = drape.measures()
    gaps = {
        line: 1e3 * gap
        for line, gap in measures["gap_m"].items()
        if "armhole" in line or line.endswith((".neck", ".bust"))
    }
    print(
        f"\n{name}: distance to the designed surface [mm]",
        {k: round(1e3 * v, 2) for k, v in measures["distance_m"].items()},
    )
    print("  gaps [mm]:", ", ".join(f"{line} {gap:.1f}" for line, gap in gaps.items()))
    print(
        f"  weft strain 95 % {100 * measures['strain_weft']['p95']:.2f} %, deepest {1e3 * measures['deepest_m']:.2f} mm"
    )
    for place in measures["places"]:
        print(f"  - {place['words']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="EU 38")
    parser.add_argument("--resolution", type=float, default=20.0)
    parser.add_argument("--fabric", default="woven")
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--compression", type=float, default=1.0, help="share of our tensile stiffness")
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    body = warpflat.Mannequin.from_size(given.size, resolution_mm=given.resolution)
    garment = warpflat.flatten_form(body, body.form("bodice"), fabric=given.fabric)
    began = time.process_time()
    ours = warpflat.drape(garment, options=warpflat.DrapeOptions(compression=given.compression))
    ended = time.process_time()
    places = newton_drape(ours.cloth, ours.body, steps=given.steps, friction=ours.options.friction)
    print(f"processor seconds: ours {ended - began:.1f}, Newton {time.process_time() - ended:.1f}")
    theirs = replace(ours, worn=replace(ours.worn, positions=places))
    show(f"warpflat, {'at rest' if ours.converged else 'NOT AT REST'}", ours)
    show("Newton", theirs)
    apart = np.linalg.norm(places - ours.positions, axis=1)
    gaps = np.abs(theirs.gap - ours.gap)
    areas = ours.areas / ours.areas.sum()
    print(
        f"\napart [mm]: the same vertex {1e3 * apart @ areas:.2f} mean, {1e3 * apart.max():.1f} most; "
        f"its gap to the body {1e3 * gaps @ areas:.2f} mean, {1e3 * gaps.max():.1f} most"
    )


if __name__ == "__main__":
    main()
