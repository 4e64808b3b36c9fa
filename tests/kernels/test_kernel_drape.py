"""Forces of cloth in space, contact and friction against NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from warpflat.kernels.drape import (
    Bending,
    Contact,
    Motion,
    evaluate_cloth,
    evaluate_curvature,
    gather_drape,
    mat32d,
)
from warpflat.kernels.drape_contact import anchor_friction, carry_contact
from warpflat.kernels.drape_steps import advance_drape, watch_power
from warpflat.kernels.drape_stiffness import stiffen_cloth, stiffen_contact

from warpflat.core.launch import launch_each
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.model.membrane import make_cloth

CURVE = ((0.02, 20.0), (0.05, 100.0))
CLOTH = Fabric(
    name="cloth", stiffness_warp=1900.0, stiffness_weft=1200.0, shear_stiffness=26.0, areal_density=0.15,
    curve_warp=CURVE, compression_factor=0.1,
)  # fmt: skip
FLAT = np.array([[0.0, 0.0], [0.01, 0.002], [0.003, 0.012]])
GRADIENT = np.linalg.inv(np.stack([FLAT[1] - FLAT[0], FLAT[2] - FLAT[0]], axis=-1))
AREA = 0.5 * abs(np.linalg.det(np.stack([FLAT[1] - FLAT[0], FLAT[2] - FLAT[0]], axis=-1)))


def on(values: object, dtype: object) -> wp.array:
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device=DEVICE)


def membrane_energy(x: np.ndarray) -> float:
    """Area times psi: warp is y and weft x, both sheet and wrinkled sheet by hand."""
    F = np.stack([x[1] - x[0], x[2] - x[0]], axis=-1) @ GRADIENT
    weft, warp = F.T
    e_warp, e_weft, gamma = np.linalg.norm(warp) - 1, np.linalg.norm(weft) - 1, warp @ weft
    energy = 0.0
    for e, k in ((e_warp, 1900.0), (e_weft, 1200.0)):
        energy += 0.5 * k * e * e * (1.0 if e > 0 else CLOTH.compression_factor)
    if e_warp > 0.0:
        places = np.linspace(0.0, e_warp, 20001)
        energy += np.trapezoid(CLOTH.tension(places), places) - 0.5 * 1900.0 * e_warp**2
    beyond = max(abs(gamma) - np.sin(np.radians(CLOTH.shear_limit)), 0.0)
    return AREA * (energy + 0.5 * 26.0 * gamma**2 + 0.5 * 260.0 * beyond**2)


def cloth_at(x: np.ndarray) -> list[object]:
    """What the kernels of one cell take whose corners lie at x (3 by 3 [m])."""
    along = GRADIENT[:, ::-1]
    law = make_cloth(CLOTH, (np.array([0.0, 1.0]), np.array([1.0, 0.0])), wp.get_device(DEVICE))
    gradient = on([[-along.sum(axis=0), *along]], mat32d)
    return [on(x, wp.vec3d), on([[0, 1, 2]], wp.vec3i), gradient, on([AREA], wp.float64), law]


def stretched(warp: float, weft: float, shear: float) -> np.ndarray:
    """The cell's corners, stretched and sheared, somehow in space."""
    x = np.column_stack([FLAT, np.zeros(3)]) * [warp, weft, 1.0]
    x[:, 0] += shear * x[:, 1]
    return np.asarray(x @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0])


def membrane_forces(x: np.ndarray) -> tuple[np.ndarray, float]:
    force = wp.zeros(3, dtype=wp.vec3d, device=DEVICE)
    energy = wp.zeros(1, dtype=wp.float64, device=DEVICE)
    launch_each(evaluate_cloth, 1, cloth_at(x), [force, energy], device=DEVICE)
    return force.numpy(), float(energy.numpy()[0])


def differences(function: Callable[[np.ndarray], np.ndarray | float], x: np.ndarray, step: float) -> np.ndarray:
    """Central differences by each coordinate of x, which come first."""
    rows = []
    for place in np.ndindex(x.shape):
        away = np.zeros(x.shape)
        away[place] = step
        rows.append((np.asarray(function(x + away)) - function(x - away)) / (2 * step))
    return np.reshape(rows, x.shape + np.shape(rows[0]))


@pytest.mark.parametrize("stretch", [(1.03, 1.01, 0.1), (0.97, 1.03, 0.0), (0.95, 0.98, 0.2), (1.1, 0.9, 0.9)])
def test_membrane_forces_are_minus_the_gradient_of_its_energy(stretch: tuple[float, float, float]):
    x = stretched(*stretch)
    force, energy = membrane_forces(x)
    assert energy == pytest.approx(membrane_energy(x), rel=1e-6)
    by_hand = -differences(membrane_energy, x, 1e-7)
    np.testing.assert_allclose(force, by_hand, atol=2e-5 * np.abs(by_hand).max())
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(by_hand).max())


@pytest.mark.parametrize("stretch", [(1.03, 1.02, 0.02), (1.015, 1.03, -0.1)])
def test_stiffness_of_pulled_cloth_is_minus_the_gradient_of_its_forces(stretch: tuple[float, float, float]):
    x = stretched(*stretch)
    stiffness = wp.zeros(9, dtype=wp.mat33d, device=DEVICE)
    launch_each(stiffen_cloth, 1, [*cloth_at(x), 0.0], [stiffness], device=DEVICE)
    by_hand = -differences(lambda at: membrane_forces(at)[0], x, 1e-8)
    blocks = stiffness.numpy().reshape(3, 3, 3, 3).transpose(0, 2, 1, 3)
    np.testing.assert_allclose(blocks, by_hand, atol=1e-5 * np.abs(by_hand).max())


def make_bending(weights: np.ndarray, stiffness: np.ndarray) -> Bending:
    bending = Bending()
    bending.offset = on(np.arange(0, weights.size + 1, len(weights)), wp.int32)
    bending.neighbor = on(np.tile(np.arange(len(weights)), len(weights)), wp.int32)
    bending.weight, bending.stiffness = on(weights.ravel(), wp.float64), on(stiffness, wp.float64)
    return bending


def test_moments_are_the_laplacian_times_the_stiffness():
    rng = np.random.default_rng(2)
    x, weights, stiffness = rng.normal(size=(4, 3)), rng.normal(size=(4, 4)), rng.random(4)
    moment = wp.zeros(4, dtype=wp.vec3d, device=DEVICE)
    launch_each(evaluate_curvature, 4, [on(x, wp.vec3d), make_bending(weights, stiffness)], [moment], device=DEVICE)
    np.testing.assert_allclose(moment.numpy(), stiffness[:, None] * (weights @ x), rtol=1e-12)


def advance(
    force: np.ndarray, velocity: np.ndarray, *, height: float = 0.0, fixed: int = 0, halted: int = 0, ball: float = 0.0
) -> dict:
    """One vertex of weight 2 N and mass 8 N/m above the level plane y = 0, or in a ball that touches it from above; friction 0.5."""
    motion, contact = Motion(), Contact()
    motion.position, motion.velocity = on([[0.0, height, 0.0]], wp.vec3d), on([velocity], wp.vec3d)
    motion.mass, motion.weight, motion.fixed = on([8.0], wp.float64), on([2.0], wp.float64), on([fixed], wp.int8)
    contact.centre, contact.normal = on([[0.0, 0.0, 0.0]], wp.vec3d), on([[0.0, 1.0, 0.0]], wp.vec3d)
    contact.ball = on([ball], wp.float64)
    contact.friction, contact.longest_step = 0.5, 1.0
    outputs = [wp.zeros(1, dtype=wp.float64, device=DEVICE) for _ in range(3)]
    lists = [on([0, 2], wp.int32), on([1, 0], wp.int32), on([0.25 * force, 1.75 * force], wp.vec3d)]
    # Bending takes back what the cells give too much.
    lists += [make_bending(np.full((1, 1), 2.0), np.ones(1)), on([0.5 * force], wp.vec3d)]
    launch_each(advance_drape, 1, [motion, contact, *lists, on([halted], wp.int32)], outputs, device=DEVICE)
    power, residual, pressing = (float(values.numpy()[0]) for values in outputs)
    x, v = motion.position.numpy()[0], motion.velocity.numpy()[0]
    return {"x": x, "v": v, "power": power, "residual": residual, "pressing": pressing}


STILL = np.zeros(3)


def test_a_free_vertex_moves_by_its_force_and_weight():
    moved = advance(np.array([4.0, 10.0, 0.0]), np.array([0.1, 0.0, 0.0]), height=0.5)
    np.testing.assert_allclose(moved["v"], [0.1 + 0.5, 1.0, 0.0] / np.hypot(0.6, 1.0))  # no step is longer than 1 m
    np.testing.assert_allclose(moved["x"], moved["v"] + [0.0, 0.5, 0.0])
    assert (moved["power"], moved["pressing"]) == (pytest.approx(0.4), 0.0)
    assert moved["residual"] == pytest.approx(np.hypot(4.0, 8.0))
    assert advance(np.array([4.0, 10.0, 0.0]), np.array([0.1, 0.0, 0.0]), height=0.5, halted=1)["power"] == 0.0


def test_a_vertex_on_the_body_sticks_slides_or_lifts_off():
    sticks = advance(np.array([0.9, 0.0, 0.0]), STILL)
    assert (sticks["pressing"], sticks["residual"]) == (pytest.approx(2.0), 0.0)
    assert not sticks["x"].any()
    begins = advance(np.array([3.0, 0.0, 4.0]), STILL)
    np.testing.assert_allclose(begins["v"], np.array([3.0, 0.0, 4.0]) * (1 - 1.0 / 5.0) / 8.0)
    slides = advance(np.array([0.0, -2.0, 0.0]), np.array([0.08, -0.3, 0.0]))
    assert slides["pressing"] == pytest.approx(4.0)
    np.testing.assert_allclose(slides["v"], [0.08 - 2.0 / 8.0, 0.0, 0.0])
    lifts = advance(np.array([0.0, 3.0, 0.0]), STILL)
    assert (lifts["pressing"], lifts["residual"]) == (0.0, pytest.approx(1.0))
    assert lifts["x"][1] == pytest.approx(1.0 / 8.0)


def test_no_vertex_is_left_inside_the_body_and_a_fixed_one_stays():
    assert advance(np.array([1.0, -50.0, 0.0]), STILL, height=0.1)["x"][1] == 0.0
    assert advance(STILL, STILL, height=-0.3)["x"][1] == 0.0
    np.testing.assert_array_equal(advance(np.ones(3), np.ones(3), height=0.2, fixed=1)["x"], [0.0, 0.2, 0.0])


def test_a_vertex_that_crosses_a_groove_stays_in_the_ball_between_its_sides():
    for way in ([1.0, -50.0, 0.0], [50.0, 0.0, 0.0], [0.0, 10.0, 0.0]):
        moved = advance(np.array(way), STILL, height=0.1, ball=0.2)
        away = np.linalg.norm(moved["x"] - [0.0, 0.2, 0.0])
        assert away == pytest.approx(0.2)


def test_friction_holds_up_to_its_share_of_what_presses():
    """Two vertices on the plane y = 0, rubbed by less and by more than Coulomb's bound, and one without a plane."""
    motion, contact = Motion(), Contact()
    places = [[1.0, 0.0, 2.0], [3.0, 0.0, 4.0], [5.0, 6.0, 7.0]]
    motion.position = on(places, wp.vec3d)
    contact.normal = on([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], wp.vec3d)
    contact.friction, contact.ball = 0.25, on(np.zeros(3), wp.float64)
    contact.pressed, contact.rubbed = on([40.0, 8.0, 5.0], wp.float64), on([[3.0, 9.0, -4.0]] * 3, wp.vec3d)
    contact.grip, contact.most = on([50.0, 50.0, 50.0], wp.float64), on(np.zeros(3), wp.float64)
    contact.anchor = on(np.zeros((3, 3)), wp.vec3d)
    launch_each(anchor_friction, 3, [motion, contact], [], device=DEVICE)
    np.testing.assert_allclose(contact.most.numpy(), [10.0, 2.0, 0.0])
    np.testing.assert_array_equal(contact.pressed.numpy(), [40.0, 8.0, 0.0])
    # In the plane 5 N were rubbed: all of it is held, or 2 N of it.
    force = np.array([[3.0, 0.0, -4.0], [1.2, 0.0, -1.6], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(contact.anchor.numpy(), places + force / 50.0, atol=1e-12)


def test_what_presses_as_deep_as_before_gets_a_stiffer_skin():
    """Above the plane y = 0: a vertex as deep as before, one at a tenth of it, one lifted off, one without a plane, two of softer cloth."""
    motion, contact = Motion(), Contact()
    motion.position = on(
        [[0.0, -1e-3, 0.0], [1.0, -1e-4, 0.0], [2.0, 0.5, 0.0], [3.0, -1.0, 0.0], *[[4.0, -1e-3, 0.0]] * 2], wp.vec3d
    )
    motion.fixed, motion.mass = on(np.zeros(6), wp.int8), on([1e5] * 4 + [2e4, 1e3], wp.float64)
    contact.centre, contact.normal = (
        on(np.zeros((6, 3)), wp.vec3d),
        on(np.outer([1, 1, 1, 0, 1, 1], [0.0, 1.0, 0.0]), wp.vec3d),
    )
    contact.skin, contact.grip = on([100.0] * 6, wp.float64), on([50.0] * 6, wp.float64)
    contact.ball = on(np.zeros(6), wp.float64)
    contact.pressed, contact.most = on([2.0] * 6, wp.float64), on(np.zeros(6), wp.float64)
    contact.anchor, contact.rubbed = on(np.zeros((6, 3)), wp.vec3d), on(np.zeros((6, 3)), wp.vec3d)
    contact.depth = on([1e-3] * 6, wp.float64)
    launch_each(carry_contact, 6, [motion, contact, 4.0], [], device=DEVICE)
    # The skin is as stiff as the cloth allows, and never softer than before.
    np.testing.assert_allclose(contact.skin.numpy(), [400.0, 100.0, 100.0, 100.0, 300.0, 100.0])
    np.testing.assert_allclose(contact.depth.numpy(), [1e-3, 1e-4, 0.0, 0.0, 1e-3, 1e-3])
    # The force is that of the old skin, and what presses lies on its plane.
    np.testing.assert_allclose(contact.pressed.numpy(), [2.1, 2.01, 0.0, 0.0, 2.1, 2.1])
    np.testing.assert_allclose(motion.position.numpy()[:, 1], [0.0, 0.0, 0.5, -1.0, 0.0, 0.0])


# Vertices that are rubbed by less and by more than Coulomb's bound, that press with what they carry alone, that lie off, and on a ball.
TOUCHING = np.array([[0.0, -1e-3, 0.0], [2.0, -2e-3, 1.0], [3.0, 1e-3, 0.0], [4.0, 0.1, 0.0], [5.0, 0.0, 0.0]])


def touching() -> Contact:
    """Contact of TOUCHING with the plane y = 0, and with a ball of 0.2 m on it."""
    contact, count = Contact(), len(TOUCHING)
    contact.centre, contact.normal = on(TOUCHING * [1.0, 0.0, 1.0], wp.vec3d), on([[0.0, 1.0, 0.0]] * count, wp.vec3d)
    contact.skin, contact.grip = on([100.0] * count, wp.float64), on([50.0] * count, wp.float64)
    contact.ball = on([0.0, 0.0, 0.0, 0.0, 0.2], wp.float64)
    contact.pressed, contact.most = on([0.0, 0.5, 0.5, 0.5, 0.5], wp.float64), on([1.0, 1.0, 1.0, 0.0, 0.0], wp.float64)
    off = np.array([[0.01, 0.3, 0.0], [0.6, 0.0, 0.8], [0.0, 0.0, 0.01], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])
    contact.anchor = on(TOUCHING + off, wp.vec3d)
    return contact


def touched(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces of body and friction at places (#V by 3), and their energy."""
    count = len(at)
    none = [on(np.zeros(count + 1), wp.int32), on([], wp.int32), wp.empty(0, wp.vec3d, DEVICE)]
    none += [make_bending(np.zeros((count, count)), np.zeros(count)), on(np.zeros((count, 3)), wp.vec3d)]
    motion = Motion()
    motion.position, motion.weight = on(at, wp.vec3d), on(np.zeros(count), wp.float64)
    motion.fixed = on(np.zeros(count), wp.int8)
    force, energy = wp.zeros(count, wp.vec3d, DEVICE), wp.zeros(count, wp.float64, DEVICE)
    launch_each(gather_drape, count, [motion, 0.0, touching(), *none], [force, energy], device=DEVICE)
    return force.numpy(), energy.numpy()


def test_forces_of_body_and_friction_are_the_gradient_of_their_energy():
    force, _ = touched(TOUCHING)
    asked = [[0.5, 0.1, 0.0], [0.6, 0.7, 0.8], [0.0, 0.4, 0.5], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    np.testing.assert_allclose(force, asked, atol=1e-12)
    for axis in np.eye(3):
        step = 1e-6 * axis
        slope = (touched(TOUCHING + step)[1] - touched(TOUCHING - step)[1]) / 2e-6
        np.testing.assert_allclose(force @ axis, -slope, atol=1e-8)


def test_stiffness_of_contact_is_minus_the_gradient_of_its_forces():
    motion, count = Motion(), len(TOUCHING)
    motion.position, motion.fixed = on(TOUCHING, wp.vec3d), on(np.zeros(count), wp.int8)
    stiffness = wp.zeros(count, wp.mat33d, DEVICE)
    launch_each(stiffen_contact, count, [motion, touching(), 7.0], [stiffness], device=DEVICE)
    for k, axis in enumerate(np.eye(3)):
        slope = (touched(TOUCHING + 1e-6 * axis)[0] - touched(TOUCHING - 1e-6 * axis)[0]) / 2e-6
        np.testing.assert_allclose(stiffness.numpy()[:, :, k], 7.0 * axis - slope, atol=1e-6)


@pytest.mark.parametrize(("sums", "halts"), [([1.0, -0.5], 0), ([1.0, -1.5], 1), ([0.0, 0.0], 0)])
def test_motion_halts_when_the_forces_do_negative_work(sums: list[float], halts: int):
    halted = wp.zeros(1, dtype=wp.int32, device=DEVICE)
    launch_each(watch_power, 1, [on(sums, wp.float64)], [halted], device=DEVICE)
    assert halted.numpy()[0] == halts
