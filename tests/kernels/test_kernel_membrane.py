"""The membrane kernel against closed forms and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from numpy.typing import NDArray
from small_networks import corner_vertices, filled
from surface_meshes import quads_between
from warpflat.kernels.cells import CellForces
from warpflat.kernels.membrane import (
    compute_membrane_energy,
    differentiate_membrane,
    evaluate_membrane,
    evaluate_membrane_potential,
)
from warpflat.kernels.strain import compute_worn_strain

from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.model.membrane import make_cloth
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.steps import IMPLICIT_STEP, TangentMatrix
from warpflat.flat.surface.half_edges import border_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface

CLOTH = Fabric(
    name="cloth",
    stiffness_warp=1000.0,
    stiffness_weft=600.0,
    shear_stiffness=50.0,
    areal_density=0.15,
    poisson_ratio=0.2,
)
CURVED = replace(
    CLOTH,
    compression_factor=0.3,
    curve_warp=((0.02, 10.0), (0.05, 40.0), (0.1, 130.0)),
    curve_weft=((0.03, 9.0), (0.08, 60.0)),
)
CLOTHS = {
    "plain": replace(CLOTH, poisson_ratio=0.0),
    "poisson": CLOTH,
    "soft shear": replace(CLOTH, shear_stiffness=6.0, poisson_ratio=0.0),
    "wrinkling": replace(CLOTH, compression_factor=0.1),
    "curved": CURVED,
}

FloatArray = NDArray[np.float64]


def evaluated(
    network: SpringNetwork, positions: FloatArray, velocities: FloatArray | None = None
) -> dict[str, FloatArray]:
    """The outputs of the force kernel over all faces, those at corners without triangles' fourth, forces summed at the vertices too."""
    f, n = network.face_count, network.vertex_count
    v = np.zeros((n, 2)) if velocities is None else velocities
    names = {
        "acting": wp.int8,
        "clearance": wp.float64,
        "force": wp.vec2d,
        "viscosity": wp.vec2d,
        "stiffness": wp.float64,
    }
    out = {k: wp.zeros(f if k in ("acting", "clearance") else 4 * f, dtype=t, device=DEVICE) for k, t in names.items()}
    at, moving = (wp.array(np.ascontiguousarray(a), dtype=wp.vec2d, device=DEVICE) for a in (positions, v))
    wp.launch(
        evaluate_membrane,
        dim=f,
        inputs=[
            at,
            moving,
            network.cells,
            network.cloth,
            0.01,
            wp.array([IMPLICIT_STEP], dtype=wp.vec3d, device=DEVICE),
            1,
            0,
        ],
        outputs=[filled(CellForces, out)],
        device=DEVICE,
    )
    found = {k: np.array(a.numpy()) for k, a in out.items()}
    energy = wp.zeros(f, dtype=wp.float64, device=DEVICE)
    made = [energy, filled(CellForces, out)]
    given = [at, network.cells, network.cloth, 0]
    wp.launch(evaluate_membrane_potential, dim=f, inputs=given, outputs=made, device=DEVICE)
    found |= {"energy": energy.numpy(), "force_again": out["force"].numpy()}
    slots, corner = corner_vertices(network)
    found |= {k: found[k][slots] for k in ("force", "force_again", "viscosity", "stiffness")}
    found["vertex_force"] = np.stack([np.bincount(corner, found["force"][:, k], minlength=n) for k in range(2)], axis=1)
    return found


def energies(network: SpringNetwork, positions: FloatArray) -> FloatArray:
    energy = wp.zeros(network.face_count, dtype=wp.float64, device=DEVICE)
    at = wp.array(np.ascontiguousarray(positions), dtype=wp.vec2d, device=DEVICE)
    wp.launch(
        compute_membrane_energy,
        dim=network.face_count,
        inputs=[at, network.cells, network.cloth, 0],
        outputs=[energy],
        device=DEVICE,
    )
    return np.array(energy.numpy())


def network_of(surface: Surface, fabric: Fabric, positions: FloatArray, **options: object) -> SpringNetwork:
    return SpringNetwork.build(surface, fabric, positions, device=DEVICE, model="membrane", **options)  # type: ignore[arg-type]


def random_triangles(seed: int = 5) -> tuple[FloatArray, FloatArray]:
    """Points in the plane and a Delaunay mesh of them, some of its triangles needles."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    inner = rng.uniform([0.02, 0.02], [0.38, 0.28], size=(60, 2))
    side = np.linspace(0, 1, 7)
    rim = [[0.4 * s, y] for s in side for y in (0.0, 0.3)] + [[x, 0.3 * s] for s in side[1:-1] for x in (0.0, 0.4)]
    points = np.concatenate([inner, np.array(rim)])
    faces = Delaunay(points).simplices
    a, b = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    faces = np.where(area[:, None] > 0, faces, faces[:, ::-1])[np.abs(area) > 1e-12]
    return points, faces


def worn(points: FloatArray, F: FloatArray, *, fold: bool) -> FloatArray:
    """The flat points under F, put into space by a turn, or folded like an accordion along the lines y = const."""
    mapped = points @ F.T
    if not fold:
        turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
        return np.column_stack([mapped, np.zeros(len(mapped))]) @ turn.T
    of_row, row = np.unique(points[:, 1], return_inverse=True)
    rows = F[1, 1] * of_row
    slope = np.where(np.arange(len(rows) - 1) % 2 == 0, 0.4, -0.7)
    y = np.concatenate([[0.0], np.cumsum(np.diff(rows) * np.cos(slope))])
    z = np.concatenate([[0.0], np.cumsum(np.diff(rows) * np.sin(slope))])
    return np.column_stack([mapped[:, 0], y[row], z[row]])


def bent_quads() -> tuple[FloatArray, FloatArray]:
    """A grid of uneven quads, straight along its rows."""
    rng = np.random.default_rng(4)
    rows = np.cumsum(rng.uniform(0.02, 0.06, size=7))
    points = []
    for y in rows:
        points += [[x, y] for x in np.cumsum(rng.uniform(0.03, 0.07, size=8))]
    faces = quads_between((7, 8))
    return np.array(points), faces


def creased_quads(diagonal: int) -> tuple[FloatArray, FloatArray]:
    """A sheet of random quads that may be folded along a diagonal of every third: the lines x - y = 0, 3, 6 and -3."""
    rng = np.random.default_rng(9)
    x, y = np.meshgrid(np.arange(10.0), np.arange(7.0))
    on_line = (x - y) % 3 == 0
    slide = np.where(on_line, rng.uniform(-0.2, 0.2, x.shape), 0.0)
    shift = np.where(on_line[..., None], slide[..., None], rng.uniform(-0.2, 0.2, (*x.shape, 2)))
    points = 0.03 * (np.stack([x, y], axis=-1) + shift).reshape(-1, 2)
    faces = quads_between((7, 10))
    if diagonal:
        points[:, 0] *= -1.0
        faces = faces[:, ::-1]
    return points, faces


def folded(points: FloatArray, F: FloatArray, diagonal: int) -> FloatArray:
    """The flat points of `creased_quads` under F, folded along its lines to and fro by different angles."""
    along = F @ np.array([-1.0 if diagonal else 1.0, 1.0])
    along = along / np.linalg.norm(along)
    out = np.array([along[1], -along[0]])
    mapped = points @ F.T
    distance = mapped @ out
    lines = np.array([-0.09, 0.0, 0.09, 0.18]) * np.sqrt(0.5)
    sign = -1.0 if diagonal else 1.0
    of_line = np.sort([(np.array([sign * d * np.sqrt(2.0), 0.0]) @ F.T) @ out for d in lines])
    breaks = np.concatenate([[distance.min() - 1.0], of_line, [distance.max() + 1.0]])
    slope = np.array([0.2, 0.9, 0.4, -0.5, 0.3])
    run = np.concatenate([[0.0], np.cumsum(np.diff(breaks) * np.cos(slope))])
    rise = np.concatenate([[0.0], np.cumsum(np.diff(breaks) * np.sin(slope))])
    return np.column_stack(
        [
            np.outer(mapped @ along, along) + np.outer(np.interp(distance, breaks, run), out),
            np.interp(distance, breaks, rise),
        ]
    )


def density(fabric: Fabric, F: FloatArray, grain_angle: float) -> float:
    """The closed form, for threads in tension and pressed ones alike."""
    warp, weft = grain_axes(grain_angle)
    e1, e2 = np.linalg.norm(F @ warp) - 1.0, np.linalg.norm(F @ weft) - 1.0
    gamma = (F @ warp) @ (F @ weft)
    nu, k1, k2 = fabric.poisson_ratio, fabric.stiffness_warp, fabric.stiffness_weft
    share = 1.0 / (1.0 - nu**2 * k2 / k1)
    return 0.5 * share * (k1 * e1**2 + k2 * e2**2 + 2 * nu * k2 * e1 * e2) + 0.5 * fabric.shear_stiffness * gamma**2


def flat_and_worn(mesh: str, F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points in the plane, faces, and the points on the body, which is the plane strained by F and folded."""
    if mesh == "random triangles":
        points, faces = random_triangles()
        return points, faces, worn(points, F, fold=False)
    if mesh == "quads bent between rows":
        points, faces = bent_quads()
        return points, faces, worn(points, F, fold=True)
    diagonal = int(mesh == "quads creased along 1-3")
    points, faces = creased_quads(diagonal)
    return points, faces, folded(points, F, diagonal)


MESHES = ["random triangles", "quads bent between rows", "quads creased along 0-2", "quads creased along 1-3"]
STRAINS = {
    "warp": [[1.0, 0.0], [0.0, 1.03]],
    "weft": [[1.04, 0.0], [0.0, 1.0]],
    "shear": [[1.0, 0.06], [0.0, 1.0]],
    "pressed": [[0.97, 0.0], [0.0, 0.99]],
    "all": [[1.02, 0.05], [0.0, 0.98]],
}


@pytest.mark.parametrize("ratio", [2.7, 100.0])
@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("mesh", MESHES)
def test_a_patch_under_uniform_strain_stores_the_membrane_s_energy(mesh: str, strain: str, ratio: float):
    fabric = replace(CLOTH, shear_stiffness=CLOTH.stiffness_weft / ratio)
    F = np.array(STRAINS[strain])
    points, faces, body = flat_and_worn(mesh, F)
    surface = make_surface(body, faces, sliver_tolerance=0.0)
    network = network_of(surface, fabric, points)
    area = 0.5 * sum(
        w * abs(np.linalg.det([points[c[1]] - points[c[0]], points[c[2]] - points[c[0]]]))
        for c, w in zip(network.cell_arrays.corner, network.cell_arrays.weight, strict=True)
    )
    assert energies(network, points).sum() == pytest.approx(area * density(fabric, F, 0.0), rel=1e-9)
    # In equilibrium inside: only the border is pulled at.
    at = evaluated(network, points)
    inside = np.setdiff1d(np.arange(len(points)), border_edges(surface.faces))
    assert len(inside) > 20
    assert np.abs(at["vertex_force"][inside]).max() < 1e-9 * np.abs(at["force"]).max()


@pytest.mark.parametrize("grain_angle", [0.0, 45.0, 70.0])
def test_the_grain_may_lie_at_any_angle(grain_angle: float):
    F = np.array([[1.03, 0.02], [0.0, 1.01]])
    points, faces = random_triangles()
    network = network_of(make_surface(worn(points, F, fold=False), faces), CLOTH, points, grain_angle=grain_angle)
    # 0.4 m by 0.3 m
    assert energies(network, points).sum() == pytest.approx(0.12 * density(CLOTH, F, grain_angle), rel=1e-9)


def one_cell(F: FloatArray, fabric: Fabric) -> tuple[FloatArray, FloatArray]:
    """Energy density of one triangle under F, with nothing meant, by either kernel that computes it; and stresses."""
    points = np.array([[0.0, 0.0], [0.1, 0.01], [0.03, 0.08]])
    surface = make_surface(worn(points, F, fold=False), [[0, 1, 2]])
    network = network_of(surface, fabric, points)
    strain, stress = (wp.zeros(1, dtype=wp.vec3d, device=DEVICE) for _ in range(2))
    energy, area = (wp.zeros(1, dtype=wp.float64, device=DEVICE) for _ in range(2))
    wp.launch(
        compute_worn_strain,
        dim=1,
        inputs=[
            wp.array(points, dtype=wp.vec2d, device=DEVICE),
            network.cells,
            make_cloth(fabric, grain_axes(0.0), network.device),
            0,
        ],
        outputs=[strain, stress, energy, area],
        device=DEVICE,
    )
    both = np.array([energy.numpy()[0], energies(network, points).sum()])
    return both / area.numpy()[0], stress.numpy()[0]


@pytest.mark.parametrize("e", [-0.04, 0.005, 0.02, 0.035, 0.07, 0.15])
def test_a_curve_is_followed_and_integrated(e: float):
    fabric = replace(CURVED, poisson_ratio=0.0)
    psi, stress = one_cell(np.diag([1.0, 1.0 + e]), fabric)
    assert psi[1] == pytest.approx(psi[0], rel=1e-12)
    assert stress[0] == pytest.approx(float(fabric.tension(e, "warp")), rel=1e-9)
    path = np.linspace(0.0, e, 200_001)
    assert psi == pytest.approx(float(np.trapezoid(fabric.tension(path, "warp"), path)), rel=1e-8)


def test_a_strip_pulled_along_a_curve_contracts_by_poisson():
    """Free across: sigma_weft = 0 at e_weft = -nu K_weft / K_weft ... e, and then sigma_warp is the curve's."""
    fabric = replace(CURVED, compression_factor=1.0)
    e = 0.06
    contraction = -fabric.poisson_ratio * e
    _, stress = one_cell(np.diag([1.0 + contraction, 1.0 + e]), fabric)
    assert stress[1] == pytest.approx(0.0, abs=1e-9)
    assert stress[0] == pytest.approx(float(fabric.tension(e, "warp")), rel=1e-9)


@pytest.mark.parametrize(
    "strain", [[[1.04, 0.1], [0.0, 0.97]], [[0.93, -0.3], [0.05, 1.02]], [[1.03, 0.45], [0.02, 1.05]]]
)
@pytest.mark.parametrize("name", CLOTHS)
def test_second_derivatives_are_those_of_the_energy(name: str, strain: list[list[float]]):
    """By the gradient of a displacement, and so by the corners' places: stretched, pressed and locked."""
    shape = np.array([[0.0, 0.0], [0.05, 0.01], [0.02, 0.06]])
    surface = make_surface(np.column_stack([shape, np.zeros(3)]), [[0, 1, 2]])
    flat = shape @ np.array(strain)
    network = network_of(surface, CLOTHS[name], flat, grain_angle=20.0)
    second, gradient = wp.zeros(1, wp.mat44d, DEVICE), wp.zeros(1, wp.mat22d, DEVICE)
    given = [wp.array(flat, dtype=wp.vec2d, device=DEVICE), network.cells, network.cloth, 0]
    wp.launch(differentiate_membrane, dim=1, inputs=given, outputs=[second, gradient], device=DEVICE)
    rows = np.vstack([-gradient.numpy()[0].sum(axis=0), gradient.numpy()[0]])
    found = np.einsum("ipjq,kp,lq->kilj", second.numpy().reshape(2, 2, 2, 2), rows, rows).reshape(6, 6)
    step, columns = 1e-7, []
    for index in range(6):
        sides = [flat.copy(), flat.copy()]
        sides[0].flat[index] += step
        sides[1].flat[index] -= step
        columns.append(
            np.subtract(*(evaluated(network, at)["vertex_force"] for at in sides[::-1])).ravel() / (2 * step)
        )
    np.testing.assert_allclose(found, np.array(columns).T, atol=1e-5 * np.abs(found).max())


@pytest.mark.parametrize("limit", [8.0, 15.0, 40.0])
def test_threads_lock_once_they_are_sheared_by_the_fabrics_limit(limit: float):
    fabric, onset = replace(CLOTH, shear_limit=limit), np.sin(np.radians(limit))

    def sheared(degrees: float) -> FloatArray:
        angle = np.radians(degrees)
        return np.array([[1.0, np.sin(angle)], [0.0, np.cos(angle)]])

    gamma = np.sin(np.radians(limit - 0.5))
    below, stress = one_cell(sheared(limit - 0.5), fabric)
    assert below == pytest.approx(0.5 * CLOTH.shear_stiffness * gamma**2, rel=1e-9)
    assert stress[2] == pytest.approx(CLOTH.shear_stiffness * gamma, rel=1e-9)
    # From there on it is eleven times as stiff, and nothing jumps.
    gamma = np.sin(np.radians(limit + 20.0))
    locked, stress = one_cell(sheared(limit + 20.0), fabric)
    energy = 0.5 * CLOTH.shear_stiffness * (gamma**2 + 10.0 * (gamma - onset) ** 2)
    assert locked == pytest.approx(energy, rel=1e-9)
    assert stress[2] == pytest.approx(CLOTH.shear_stiffness * (gamma + 10.0 * (gamma - onset)), rel=1e-9)
    other, back = one_cell(sheared(-limit - 20.0), fabric)
    np.testing.assert_allclose([*other, back[2]], [*locked, -stress[2]], rtol=1e-9)


def test_pressed_cloth_wrinkles():
    fabric = replace(CLOTH, compression_factor=0.1)
    both, stress = one_cell(np.diag([0.97, 0.98]), fabric)
    assert both == pytest.approx(0.1 * density(fabric, np.diag([0.97, 0.98]), 0.0), rel=1e-9)
    assert (stress[:2] < 0).all()
    # Pulled along the warp and pressed across it, the warp carries on alone.
    F = np.diag([0.97, 1.03])
    one, _ = one_cell(F, fabric)
    alone = 0.5 * fabric.stiffness_warp * 0.03**2
    assert one == pytest.approx(0.1 * density(fabric, F, 0.0) + 0.9 * alone, rel=1e-9)
    # What a thread contracts of itself is no wrinkle: with stress across still pulling, nothing changes.
    F = np.diag([0.999, 1.03])
    assert one_cell(F, fabric)[0] == pytest.approx(density(fabric, F, 0.0), rel=1e-9)


@pytest.mark.parametrize("shear", [0.0, 1.3])
@pytest.mark.parametrize("meant", [None, (1.1, 1.25)])
@pytest.mark.parametrize("name", CLOTHS)
def test_forces_are_minus_the_gradient(name: str, meant: tuple[float, float] | None, shear: float):
    x, y = np.meshgrid([-0.1, 0.0, 0.1], [0.0, 0.11, 0.24])
    points = np.stack([x + 0.01 * y, y, 1.5 * x**2 - 0.8 * y**2], axis=-1).reshape(-1, 3)
    faces = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, -1], [3, 7, 6, -1], [4, 5, 8, -1], [4, 8, 7, -1]]
    surface = make_surface(points, faces)
    stretch = None if meant is None else np.tile(meant, (6, 1))
    network = network_of(surface, CLOTHS[name], points[:, :2], grain_angle=20.0, stretch=stretch)
    flat = 0.97 * points[:, :2] @ np.array([[1.0, 0.0], [shear, 1.0]])
    flat += np.random.default_rng(1).normal(scale=0.004, size=(9, 2))
    found = evaluated(network, flat)
    force = found["vertex_force"]
    # The kernel that takes energies and forces at once.
    np.testing.assert_allclose(found["force_again"], found["force"], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found["energy"], energies(network, flat), rtol=1e-9)
    step, slope = 1e-7, np.zeros_like(flat)
    for i, k in np.ndindex(flat.shape):
        there, back = flat.copy(), flat.copy()
        there[i, k] += step
        back[i, k] -= step
        slope[i, k] = (energies(network, there).sum() - energies(network, back).sum()) / (2 * step)
    np.testing.assert_allclose(force, -slope, atol=1e-7 * np.abs(force).max())
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize("name", ["plain", "poisson", "soft shear"])
@pytest.mark.parametrize("mesh", ["random triangles", "bent quads"])
def test_the_step_s_matrix_bounds_the_membrane_s_stiffness(mesh: str, name: str):
    """At rest, x . H x <= sum k_ij |x_i - x_j|^2 for every displacement, on any mesh."""
    points, faces = random_triangles() if mesh == "random triangles" else bent_quads()
    surface = make_surface(worn(points, np.eye(2), fold=mesh == "bent quads"), faces, sliver_tolerance=0.0)
    network = network_of(surface, CLOTHS[name], points, grain_angle=30.0)
    n, step = len(points), 1e-7
    hessian = np.zeros((2 * n, 2 * n))
    for column in range(2 * n):
        moved = np.zeros(2 * n)
        moved[column] = step
        sides = [evaluated(network, points + s * moved.reshape(n, 2))["vertex_force"].ravel() for s in (1, -1)]
        hessian[:, column] = (sides[1] - sides[0]) / (2 * step)
    springs = network.spring_arrays
    laplacian = np.zeros((n, n))
    (i, j), k = springs.ends.T, springs.stiffness
    np.add.at(laplacian, (i, i), k)
    np.add.at(laplacian, (j, j), k)
    np.add.at(laplacian, (i, j), -k)
    np.add.at(laplacian, (j, i), -k)
    assert (k >= 0).all()
    slack = np.linalg.eigvalsh(np.kron(laplacian, np.eye(2)) - 0.5 * (hessian + hessian.T))
    assert slack.min() > -1e-5 * np.abs(hessian).max()
    held = np.bincount(network.cell_arrays.corner.ravel(), network.cloth.held.numpy(), minlength=n)
    np.testing.assert_allclose(held, np.diag(laplacian), rtol=1e-12)


@pytest.mark.parametrize("name", ["plain", "poisson", "soft shear"])
@pytest.mark.parametrize("mesh", ["random triangles", "bent quads"])
def test_viscosity_is_the_rate_of_the_forces_over_a_time_step(mesh: str, name: str):
    points, faces = random_triangles() if mesh == "random triangles" else bent_quads()
    surface = make_surface(worn(points, np.eye(2), fold=mesh == "bent quads"), faces)
    network = network_of(surface, CLOTHS[name], points, grain_angle=20.0)
    moving = np.random.default_rng(6).normal(size=points.shape)
    viscosity = evaluated(network, points, moving)["viscosity"]
    step = 1e-8
    there, back = (evaluated(network, points + s * step * moving)["force"] for s in (1, -1))
    np.testing.assert_allclose(viscosity, 0.01 * (there - back) / (2 * step), atol=1e-5 * np.abs(viscosity).max())


def test_the_matrix_that_follows_bounds_the_stiffness_of_the_present_layout_and_is_the_same_at_rest():
    points, faces = random_triangles()
    network = network_of(make_surface(worn(points, np.eye(2), fold=False), faces), CLOTHS["soft shear"], points)
    at_rest = np.array(network.springs.stiffness.numpy())
    matrix = TangentMatrix(network)
    matrix.update(wp.array(points, dtype=wp.vec2d, device=DEVICE))
    np.testing.assert_allclose(network.springs.stiffness.numpy(), at_rest, rtol=1e-6, atol=1e-9 * at_rest.max())
    flat = points @ np.array([[1.2, 0.4], [0.0, 0.8]])
    matrix.update(wp.array(flat, dtype=wp.vec2d, device=DEVICE))
    assert np.abs(network.springs.stiffness.numpy() - at_rest).max() > 0.5 * at_rest.max()
    # Nothing is left for the diagonal, and x . H x <= sum k_ij |x_i - x_j|^2 for the part of H without second derivatives.
    assert evaluated(network, flat)["stiffness"].max() < 1e-9 * at_rest.max()
    springs, rng = network.springs, np.random.default_rng(7)
    offset, neighbor = springs.offset.numpy(), springs.neighbor.numpy()
    k, here = (
        springs.stiffness.numpy(),
        np.repeat(np.arange(len(flat)), np.diff(springs.offset.numpy())),
    )
    assert offset[-1] == len(neighbor)
    for trial in range(40):
        v = rng.normal(size=flat.shape) if trial % 2 else np.sin(flat @ rng.normal(size=(2, 2)) * 20.0)
        viscosity = evaluated(network, flat, v)["viscosity"]
        power = -np.einsum("ij,ij->", viscosity, v[network.cell_arrays.corner.ravel()]) / 0.01
        held = 0.5 * (k * ((v[here] - v[neighbor]) ** 2).sum(axis=1)).sum()
        assert 0.0 <= power <= held * (1.0 + 1e-12)


def test_a_collapsing_cell_costs_without_bound_and_a_mirrored_one_is_refused():
    points = np.array([[0.0, 0.0], [0.1, 0.0], [0.04, 0.1]])
    surface = make_surface(worn(points, np.eye(2), fold=False), [[0, 1, 2]])
    network = network_of(surface, CLOTH, points)
    found = [energies(network, points * [1.0, s])[0] for s in (1.0, 1e-2, 1e-4, 1e-6)]
    assert found[0] == pytest.approx(0.0, abs=1e-18)
    assert found[2] > 50 * found[1] > 0
    assert found[3] > 50 * found[2]
    for flat in (points * [1.0, 0.0], points * [1.0, -1.0]):
        assert np.isinf(energies(network, flat)[0])
        at = evaluated(network, flat)
        assert at["acting"][0] == 0
        assert at["clearance"][0] == 0.0


def test_viscosity_leaves_a_cell_alone_that_moves_as_a_whole_and_runs_repeat_bit_for_bit():
    points, faces = random_triangles()
    network = network_of(make_surface(worn(points, np.eye(2), fold=False), faces), CURVED, points)
    flat = 0.9 * points
    shift = evaluated(network, flat, np.tile([0.3, -0.2], (len(points), 1)))
    assert shift["stiffness"].max() > 0
    assert np.abs(shift["viscosity"]).max() < 1e-12 * shift["stiffness"].max()
    moving = np.random.default_rng(3).normal(size=points.shape)
    first, again = evaluated(network, flat, moving), evaluated(network, flat, moving)
    # It takes energy out of every cell.
    v = moving[network.cell_arrays.corner]
    power = np.einsum("cki,cki->c", first["viscosity"].reshape(-1, 3, 2), v)
    assert (power <= 1e-12).all()
    assert all(np.array_equal(first[name], again[name]) for name in first)
