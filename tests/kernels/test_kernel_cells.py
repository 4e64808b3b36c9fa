"""The thread guard on cells: energy, force, stiffness bound, clearance, and what becomes of collapsed cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from small_networks import CLOTH, DEVICE, Launched, corner_vertices, shaken, small_network
from warpflat.kernels.guard import is_beyond_anywhere

from warpflat.flat.fabric.fabric import grain_axes
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.steps import IMPLICIT_STEP, IMPLICIT_STEP_AT_REST
from warpflat.flat.surface.repair.validate import make_surface

# How the patch, seen from the front, is made larger or smaller along weft and warp.
SQUEEZES = {"none": (1.15, 1.2), "warp": (1.15, 0.8), "weft": (0.8, 1.2), "both": (0.75, 0.7)}


def guard_energy_by_hand(network: SpringNetwork, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """#F, the sum over the cells of a [1/2 K_warp <|F e_warp| - 1 - onset_warp>^2 + the same for weft + 1/2 G <F s . F t>^2], G what the
    springs lack in shear, s and t unit vectors along and across."""
    fabric, cells, energies = network.fabric, network.cell_arrays, []
    shears = network.cells.shear.numpy()[cells.face]
    for corner, edges, weight, shear in zip(cells.corner, cells.edges, cells.weight, shears, strict=True):
        flat = np.stack(
            [positions[corner[1]] - positions[corner[0]], positions[corner[2]] - positions[corner[0]]], axis=1
        )
        area = 0.5 * np.linalg.det(flat)
        deformation = edges @ np.linalg.inv(flat)
        density = 0.0
        for thread, stiffness, onset in zip(
            grain_axes(network.grain_angle),
            (fabric.stiffness_warp, fabric.stiffness_weft),
            map(float, network.guard.onset),
            strict=True,
        ):
            excess = np.linalg.norm(deformation @ thread) - 1.0 - onset
            density += 0.5 * stiffness * max(excess, 0.0) ** 2
        lack = np.linalg.norm(shear) ** 4
        if lack > 0.0:
            s = shear / np.linalg.norm(shear)
            t = np.array([-s[1], s[0]])
            density += 0.5 * lack * ((deformation @ s) @ (deformation @ t)) ** 2
        energies.append(weight * area * density)
    hourglass = network.spring_arrays.hourglass
    waves = 0.0 if hourglass is None else np.einsum("fk,fkd->fd", hourglass, positions[network.surface.faces])
    return np.bincount(cells.face, energies) + 0.5 * np.square(waves).sum(axis=-1)


def lacking(network: SpringNetwork, shear: float) -> SpringNetwork:
    """The same whose faces lack so much in shear [N/m], in directions of their own, every third nothing."""
    angle = np.random.default_rng(6).uniform(0.0, 2.0 * np.pi, network.face_count)
    lack = shear**0.25 * np.column_stack([np.cos(angle), np.sin(angle)])
    lack[2::3] = 0.0
    return replace(network, spring_arrays=replace(network.spring_arrays, shear_deficit=lack, hourglass=None))


def held(network: SpringNetwork) -> SpringNetwork:
    """The same whose quads are held against waves, every third by nothing."""
    rng = np.random.default_rng(8)
    wave = rng.uniform(5.0, 20.0, (network.face_count, 1)) * rng.normal(
        [1.0, -1.0, 1.0, -1.0], 0.2, (network.face_count, 4)
    )
    wave[2::3] = 0.0
    wave[~network.surface.is_quad] = 0.0
    return replace(network, spring_arrays=replace(network.spring_arrays, hourglass=wave))


def one_cell(shape: NDArray[np.float64]) -> SpringNetwork:
    """A network of one triangle (3 by 2 [m])."""
    surface = make_surface(np.column_stack([shape, np.zeros(3)]), [[0, 1, 2]])
    network = SpringNetwork.build(surface, CLOTH, shape, grain_angle=0.0, device=DEVICE)
    return replace(network, model="springs", held_stiffness=None)


def random_cell(seed: int) -> tuple[SpringNetwork, NDArray[np.float64]]:
    """A triangle on the body and one in the plane, strained by up to a half, neither a sliver."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi) + 2 * np.pi * (np.arange(3) + rng.uniform(-0.25, 0.25, 3)) / 3
    shape = 0.02 * np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.6, 1.4, (3, 1))
    stretch = np.diag(rng.uniform(0.55, 1.1, 2)) + rng.uniform(-0.1, 0.1, (2, 2))
    return one_cell(shape), shape @ stretch


@pytest.mark.parametrize("shear", [0.0, 150.0])
@pytest.mark.parametrize("grain_angle", [0.0, 45.0, 110.0])
@pytest.mark.parametrize("active", SQUEEZES)
def test_energy_is_that_of_the_formula(active: str, grain_angle: float, shear: float):
    network = lacking(small_network(grain_angle=grain_angle), shear)
    positions = shaken(network, scale=1.0, noise=0.001) * SQUEEZES[active]
    by_hand = guard_energy_by_hand(network, positions)
    np.testing.assert_allclose(Launched(network, positions).guard_energy(), by_hand, rtol=1e-10, atol=1e-12)
    if active == "both":
        assert (by_hand > 0).all()


@pytest.mark.parametrize("shear", [0.0, 150.0])
@pytest.mark.parametrize("grain_angle", [0.0, 30.0])
@pytest.mark.parametrize("active", SQUEEZES)
def test_forces_are_minus_the_gradient_of_the_energy(active: str, grain_angle: float, shear: float):
    network = lacking(small_network(grain_angle=grain_angle), shear)
    positions = shaken(network, scale=1.0, noise=0.001) * SQUEEZES[active]
    at = Launched(network, positions).evaluate_guard()
    corner_force = at["face_force"].reshape(-1, 4, 2) * at["face_acting"][:, None, None]
    slots, vertices = corner_vertices(network)
    force = np.zeros_like(positions)
    np.add.at(force, vertices, corner_force.reshape(-1, 2)[slots])
    step, size = 1e-7, max(np.abs(force).max(), 1e-3)
    for vertex in range(network.vertex_count):
        for axis in (0, 1):
            moved = np.stack([positions, positions])
            moved[0, vertex, axis] += step
            moved[1, vertex, axis] -= step
            slope = np.subtract(*(Launched(network, p).guard_energy().sum() for p in moved)) / (2 * step)
            assert force[vertex, axis] == pytest.approx(-slope, abs=2e-6 * size)
    if active == "none" and not shear:
        assert not force.any()
    else:
        assert np.abs(force).max() > (0.1 if active == "none" else 1.0)


@pytest.mark.parametrize("scale", [1.0, 0.8])
def test_waves_store_their_amplitude_squared_and_pull_back(scale: float):
    network = held(small_network())
    rng = np.random.default_rng(2)
    positions, velocities = shaken(network, scale=scale), rng.normal(size=(network.vertex_count, 2))
    np.testing.assert_allclose(
        Launched(network, positions).guard_energy(), guard_energy_by_hand(network, positions), rtol=1e-10, atol=1e-12
    )
    without = replace(network, spring_arrays=replace(network.spring_arrays, hourglass=None))
    here, there = (Launched(net, positions, velocities, time_step=0.02).evaluate_guard() for net in (network, without))
    hourglass, faces = network.spring_arrays.hourglass, network.surface.faces
    is_held = hourglass.any(axis=1)
    assert is_held.any()
    assert (here["face_acting"][is_held] == 1).all()
    amplitude, moving = (np.einsum("fk,fkd->fd", hourglass, values[faces]) for values in (positions, velocities))
    expected = {
        "face_force": -hourglass[:, :, None] * amplitude[:, None],
        "face_viscosity": -0.02 * hourglass[:, :, None] * moving[:, None],
        "face_stiffness": np.abs(hourglass) * np.abs(hourglass).sum(axis=1, keepdims=True),
    }
    for name, more in expected.items():
        shape = more.shape
        before = there[name].reshape(shape) * (there["face_acting"] != 0).reshape(-1, *[1] * (len(shape) - 1))
        np.testing.assert_allclose(here[name].reshape(shape)[is_held], (before + more)[is_held], rtol=1e-9, atol=1e-9)


def test_each_direction_acts_alone():
    """Squeezed across the other threads, a cell's force comes from one family only: it has that thread's direction."""
    shape = np.array([[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]])
    network = one_cell(shape)
    for squeeze, axis in (((1.0, 0.8), 1), ((0.8, 1.0), 0)):
        at = Launched(network, shape * squeeze).evaluate_guard()
        force = at["face_force"]
        assert force[1 + axis, axis] > 0.1
        # the other threads feel the area only: 1/2 K y^2 a / l, small against K y a / l
        assert 0 <= -force[2 - axis, 1 - axis] < 0.2 * force[1 + axis, axis]


def test_the_share_of_the_force_that_no_one_else_balances_is_zero():
    network = small_network()
    at = Launched(network, shaken(network, scale=0.8)).evaluate_guard()
    force = at["face_force"].reshape(-1, 4, 2)
    assert at["face_acting"].all()
    np.testing.assert_allclose(force.sum(axis=1), 0.0, atol=1e-12 * np.abs(force).max())


def corner_hessian(network: SpringNetwork, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """6 by 6, second derivative of one cell's guard energy by its corners, from differences of its forces."""
    step, columns = 1e-7, []
    for index in range(6):
        sides = []
        for sign in (1.0, -1.0):
            moved = positions.copy()
            moved.ravel()[index] += sign * step
            sides.append(Launched(network, moved).evaluate_guard()["face_force"][:3].ravel())
        columns.append((sides[1] - sides[0]) / (2 * step))
    return np.array(columns)


@pytest.mark.parametrize("shear", [0.0, 20.0, 2000.0])
@pytest.mark.parametrize("seed", range(30))
def test_stiffness_bounds_the_second_derivative(seed: int, shear: float):
    """Of each corner moved alone by twice; and of all three at once within a factor of 2, beyond which an explicit
    update by force over stiffness would diverge."""
    network, positions = random_cell(seed)
    network = lacking(network, shear)
    at = Launched(network, positions).evaluate_guard()
    hessian, bound = corner_hessian(network, positions), at["face_stiffness"][:3]
    hessian = 0.5 * (hessian + hessian.T)
    assert at.guard_energy()[0] > 0
    for corner in range(3):
        block = hessian[2 * corner : 2 * corner + 2, 2 * corner : 2 * corner + 2]
        assert np.linalg.eigvalsh(block).max() <= 0.5 * bound[corner] * (1 + 1e-5)
    scale = np.repeat(bound, 2) ** -0.5
    assert np.linalg.eigvalsh(scale[:, None] * hessian * scale).max() < 1.8


def test_stiffness_counts_from_half_of_the_onset():
    shape = np.array([[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]])
    network = one_cell(shape)
    onset = float(network.guard.onset[0])
    for share, acts in ((0.4, 0), (0.6, 1)):
        at = Launched(network, shape * [1.1, 1.0 / (1.0 + share * onset)]).evaluate_guard()
        assert at["face_acting"][0] == acts
        assert not at["face_force"].any()
        assert at["face_stiffness"].any() == bool(acts)
        assert at.guard_energy()[0] == 0.0


def test_slender_cells_always_count():
    """Far from squeezed along both threads, a needle is one step away from it."""
    shape = np.array([[0.0, 0.0], [0.1, 0.0], [0.05, 0.004]])
    at = Launched(one_cell(shape), 1.5 * shape).evaluate_guard()
    assert at["face_acting"][0] == 1
    assert (at["face_stiffness"] > 0).any()
    assert not at["face_force"].any()


@pytest.mark.parametrize("time_step", [1e-3, 10.0])
def test_viscosity_pulls_towards_the_cells_mean_velocity(time_step: float):
    network, positions = random_cell(5)
    velocities = np.random.default_rng(8).normal(size=(3, 2))
    at = Launched(network, 0.8 * positions, velocities, time_step).evaluate_guard()
    stiffness = at["face_stiffness"][:3]
    by_hand = time_step * stiffness[:, None] * (stiffness @ velocities / stiffness.sum() - velocities)
    assert np.abs(by_hand).max() > 0
    np.testing.assert_allclose(at["face_viscosity"][:3], by_hand, rtol=1e-10, atol=1e-12)
    assert (by_hand * velocities).sum() <= 0


def test_viscosity_leaves_what_moves_as_a_whole_alone():
    network = small_network()
    moving = np.tile([[0.3, -0.2]], (network.vertex_count, 1))
    at = Launched(network, shaken(network, scale=0.8), moving).evaluate_guard()
    assert at["face_stiffness"].max() > 0
    np.testing.assert_allclose(at["face_viscosity"], 0.0, atol=1e-11 * at["face_stiffness"].max())


@pytest.mark.parametrize("squeeze", [1.0, 0.93, 0.8])
def test_a_quad_does_half_of_what_its_four_corner_triangles_do(squeeze: float):
    """Whether all, some or none of them are squeezed."""
    shape = np.array([[0.0, 0.0], [0.1, 0.01], [0.11, 0.12], [0.0, 0.1]])
    surface = make_surface(np.column_stack([shape, np.zeros(4)]), [[0, 1, 2, 3]])
    network = SpringNetwork.build(surface, CLOTH, shape, device=DEVICE)
    rng = np.random.default_rng(4)
    positions, velocities = squeeze * shape, rng.normal(size=(4, 2))
    positions[2] *= 0.93
    at = Launched(network, positions, velocities, 0.02).evaluate_guard()
    names = ("face_force", "face_viscosity", "face_stiffness")
    sums = {name: np.zeros_like(at[name]) for name in names}
    energy, heights, acting = 0.0, [], []
    for k in range(4):
        corners = [(k - 1) % 4, k, (k + 1) % 4]
        cell = Launched(one_cell(shape[corners]), positions[corners], velocities[corners], 0.02).evaluate_guard()
        for name in names:
            sums[name][corners] += 0.5 * cell[name][:3]
        energy += 0.5 * cell.guard_energy()[0]
        heights.append(cell["face_clearance"][0])
        acting.append(cell["face_acting"][0])
    assert sum(acting) == {1.0: 3, 0.93: 4, 0.8: 4}[squeeze]
    for name in names:
        np.testing.assert_allclose(at[name], sums[name], rtol=1e-11, atol=1e-12, err_msg=name)
    assert at.guard_energy()[0] == pytest.approx(energy, rel=1e-12)
    assert at["face_clearance"][0] == pytest.approx(min(heights), rel=1e-12)


def test_clearance_is_the_least_height():
    network = small_network()
    positions = shaken(network, scale=1.0)
    at = Launched(network, positions).evaluate_guard()
    p = positions[network.cell_arrays.corner]
    area = 0.5 * np.linalg.det(np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2))
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    least = np.minimum.reduceat(2 * area / longest, network.cell_arrays.first)
    np.testing.assert_allclose(at["face_clearance"], least, rtol=1e-12)


def test_the_least_share_of_area_says_which_faces_have_lost_a_cell():
    network = small_network()
    cells, body = network.cell_arrays, network.surface.vertices[:, :2]
    positions = shaken(network, scale=0.9)
    positions[0] = [0.15, 0.3]
    p = positions[cells.corner]
    flat = 0.5 * np.linalg.det(np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2))
    least = np.minimum.reduceat(cells.weight * flat / cells.area, cells.first)
    np.testing.assert_allclose(cells.least_shares(positions), least, rtol=1e-10)
    assert least[0] < 0 < least[1]
    assert (cells.least_shares(body) > 0.9).all()


@pytest.mark.parametrize(
    "layout",
    [
        [[0.0, 0.0], [0.0, 0.02], [0.02, 0.0]],
        [[0.0, 0.0], [0.01, 0.0], [0.02, 0.0]],
        [[0.01, 0.01], [0.01, 0.01], [0.02, 0.0]],
        [[0.01, 0.01], [0.01, 0.01], [0.01, 0.01]],
    ],
    ids=["mirrored", "collapsed", "two corners in one", "a point"],
)
def test_a_lost_cell_is_infinite_in_energy_and_has_no_force(layout: list[list[float]]):
    network = one_cell(np.array([[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]]))
    at = Launched(network, np.array(layout)).evaluate_guard()
    assert at["face_acting"][0] == 0
    assert at["face_clearance"][0] == 0.0
    assert not at["face_force"].any()
    assert at.guard_energy()[0] == np.inf


def test_nearly_collapsed_cells_stay_finite_and_push_apart():
    shape = np.array([[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]])
    network = one_cell(shape)
    for squeeze in (1e-3, 1e-6, 1e-9):
        at = Launched(network, shape * [1.0, squeeze]).evaluate_guard()
        assert np.isfinite(at["face_force"]).all()
        assert np.isfinite(at["face_stiffness"]).all()
        assert at["face_force"][2, 1] > 0
        # 1/2 K <1/s - 1 - onset>^2 s A
        onset = float(network.guard.onset[0])
        energy = 0.5 * CLOTH.stiffness_warp * (1 / squeeze - 1 - onset) ** 2 * squeeze * 0.0002
        assert at.guard_energy()[0] == pytest.approx(energy, rel=1e-9)


def test_pieces_of_a_launch_equal_the_whole():
    network = small_network()
    velocities = np.random.default_rng(2).normal(size=(network.vertex_count, 2))
    arguments = (network, shaken(network, scale=0.8), velocities)
    whole, parts = Launched(*arguments).evaluate_guard(), Launched(*arguments, pieces=2).evaluate_guard()
    for name in ("face_acting", "face_clearance", "face_force", "face_viscosity", "face_stiffness"):
        assert np.array_equal(whole[name], parts[name]), name
    assert np.array_equal(whole.guard_energy(), parts.guard_energy())


def test_a_long_quad_always_counts_and_the_stretch_that_is_meant_is_at_rest():
    """Worn stretched as it is meant to be, it is not sheared, whichever way the grain runs; a little on from there it is."""
    shape = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.01], [0.0, 0.01]])
    surface = make_surface(np.column_stack([shape, np.zeros(4)]), [[0, 1, 2, 3]])
    for angle in (0.0, 20.0):
        fabric, stretch = replace(CLOTH, shear_stiffness=200.0), np.array([[1.05, 1.02]])
        warp, weft = grain_axes(angle)
        network = SpringNetwork.build(
            surface, fabric, shape, grain_angle=angle, device=DEVICE, model="springs", stretch=stretch
        )
        assert network.spring_arrays.long_quads == 1
        smaller = np.outer(warp, warp) / 1.05 + np.outer(weft, weft) / 1.02
        at = Launched(network, shape @ smaller).evaluate_guard()
        assert at["face_acting"][0] == 1
        assert (at["face_stiffness"] > 0.0).all()
        rest, sheared = (
            Launched(network, shape @ by).guard_energy()[0] for by in (smaller, smaller + 0.02 * np.eye(2)[::-1])
        )
        assert rest < 1e-6 * sheared


def test_without_viscosity_none_is_written_and_all_else_is_the_same():
    network = small_network()
    velocities = np.random.default_rng(3).normal(size=(network.vertex_count, 2))
    with_it, without = (
        Launched(network, shaken(network, scale=0.8), velocities, coefficients=coefficients).evaluate_guard()
        for coefficients in (IMPLICIT_STEP, IMPLICIT_STEP_AT_REST)
    )
    for name in ("face_acting", "face_clearance", "face_force", "face_stiffness"):
        np.testing.assert_array_equal(with_it[name], without[name])
    assert with_it["face_viscosity"].any()
    assert not without["face_viscosity"].any()


def test_energy_and_forces_at_once_are_those_of_a_step_and_of_the_energy_alone():
    network = small_network()
    at, alone = (Launched(network, shaken(network, scale=0.8)) for _ in range(2))
    at.evaluate_guard().gather_forces()
    alone.evaluate_potential()
    assert alone["face_acting"].any()
    np.testing.assert_allclose(alone["force"], at["force"], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(alone["face_energy"], at.guard_energy(), rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(alone["energy"], at.spring_energy(), rtol=1e-12, atol=1e-18)


@wp.kernel
def _ask_beyond(
    a: wp.array(dtype=wp.vec2d),
    b: wp.array(dtype=wp.vec2d),
    unit: wp.float64,
    stretch: wp.float64,
    answer: wp.array(dtype=bool),
):
    i = wp.tid()
    answer[i] = is_beyond_anywhere(a[i], b[i], unit, stretch)


@pytest.mark.parametrize("unit", [0.4, 2.5])
def test_a_sheet_is_beyond_where_its_largest_singular_value_is(unit: float):
    deformations = unit * np.random.default_rng(3).normal(0.0, 0.7, (200, 2, 2))
    longest = np.linalg.svd(deformations, compute_uv=False)[:, 0]
    a, b = (wp.array(deformations[:, :, k], dtype=wp.vec2d, device=DEVICE) for k in range(2))
    answer = wp.zeros(200, dtype=bool, device=DEVICE)
    wp.launch(_ask_beyond, dim=200, inputs=[a, b, unit, 0.1], outputs=[answer], device=DEVICE)
    np.testing.assert_array_equal(answer.numpy(), longest > 1.1 * unit)
    assert 20 < answer.numpy().sum() < 180
