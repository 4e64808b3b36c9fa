"""Relaxation: the minimum that others find, from any time step; known patterns; repeats, limits and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from devices import DEVICE
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.core.vectors import laid_upon
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.flattening.develop import develop
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation, relax_by_steps
from warpflat.flat.surface.half_edges import mesh_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]

TIGHT = RelaxOptions(residual_tolerance=1e-5, energy_tolerance=1e-9)


def cloth(shear: float) -> Fabric:
    return Fabric(name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=shear, areal_density=0.15)


def developed(surface: Surface, shear: float) -> tuple[SpringNetwork, FloatArray]:
    start = develop(surface, surface.lines["centre"]).positions
    return SpringNetwork.build(surface, cloth(shear), start, device=DEVICE), start


def springs_and_guard(network: SpringNetwork, positions: FloatArray) -> tuple[float, FloatArray]:
    """What is minimised, and its gradient, in NumPy."""
    s, c, fabric = network.spring_arrays, network.cell_arrays, network.fabric
    d = positions[s.ends[:, 1]] - positions[s.ends[:, 0]]
    length = np.linalg.norm(d, axis=1)
    energy = float((0.5 * s.stiffness * (length - s.rest_length) ** 2).sum())
    pull = (s.stiffness * (1.0 - s.rest_length / length))[:, None] * d
    gradient = np.zeros_like(positions)
    np.add.at(gradient, s.ends[:, 1], pull)
    np.add.at(gradient, s.ends[:, 0], -pull)
    p = positions[c.corner]
    flat = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2)
    det = np.linalg.det(flat)
    if det.min() <= 0:
        return math.inf, gradient
    inverse = np.linalg.inv(flat)
    deformation = c.edges @ inverse
    area = 0.5 * det * c.weight
    stress, density = np.zeros_like(deformation), np.zeros(len(det))
    for thread, stiffness, onset in zip(
        grain_axes(network.grain_angle),
        (fabric.stiffness_warp, fabric.stiffness_weft),
        map(float, network.guard.onset),
        strict=True,
    ):
        worn = deformation @ thread
        stretch = np.linalg.norm(worn, axis=1)
        excess = np.maximum(stretch - 1.0 - onset, 0.0)
        density += 0.5 * stiffness * excess**2
        stress += (stiffness * excess / stretch)[:, None, None] * worn[:, :, None] * thread
    turned = np.swapaxes(inverse, 1, 2)
    slope = area[:, None, None] * (density[:, None, None] * turned - np.swapaxes(deformation, 1, 2) @ stress @ turned)
    np.add.at(gradient, c.corner[:, 1], slope[:, :, 0])
    np.add.at(gradient, c.corner[:, 2], slope[:, :, 1])
    np.add.at(gradient, c.corner[:, 0], -slope.sum(axis=2))
    return energy + float((area * density).sum()), gradient


def lbfgs(network: SpringNetwork, start: FloatArray) -> float:
    from scipy.optimize import minimize

    scale = springs_and_guard(network, start)[0]

    def energy(flat: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = springs_and_guard(network, flat.reshape(-1, 2))
        return (value / scale if math.isfinite(value) else 1e6), gradient.ravel() / scale

    options = {"maxiter": 5000, "maxfun": 10_000, "maxcor": 30, "ftol": 1e-13, "gtol": 1e-7}
    return float(minimize(energy, start.ravel(), jac=True, method="L-BFGS-B", options=options).fun) * scale


# --- the minimum


@pytest.mark.parametrize("shear", [200.0, 20.0])
@pytest.mark.parametrize(("shape", "parameters"), [("hemisphere", {"opening": 60.0}), ("saddle", {})])
def test_a_cap_and_a_saddle_reach_the_minimum_that_lbfgs_finds(shape, parameters, shear):
    surface = make_shape(shape, resolution=11, **parameters)
    network, start = developed(surface, shear)
    state = Relaxation(network, RelaxOptions(residual_tolerance=5e-4), start=start)
    outcome = relax_by_steps(state)
    assert outcome.converged
    by_hand, gradient = springs_and_guard(network, state.positions())
    assert outcome.energies.potential == pytest.approx(by_hand, rel=1e-10)
    np.testing.assert_allclose(-state.force.numpy(), gradient, atol=1e-3 * np.abs(gradient).max() + 1e-4)
    assert outcome.energies.potential == pytest.approx(lbfgs(network, start), rel=1e-3)


def last_step_off(potential: list[float], minimum: float) -> int:
    """Steps until the energy is, and stays, within 0.1 % of the minimum."""
    off = np.flatnonzero(np.abs(np.array(potential) / minimum - 1.0) > 1e-3)
    return int(off[-1]) + 2 if len(off) else 1


def run(
    network: SpringNetwork, start: FloatArray, *, time_step: float, damped: bool, steps: int
) -> tuple[list[float], list[float]]:
    """Potential energies, and total ones, at the start and after every step."""
    state, mass = (
        Relaxation(network, RelaxOptions(time_step=time_step, kinetic_damping=damped), start=start),
        network.mass.numpy(),
    )
    potential = [state.energies().potential]
    total = list(potential)
    for _ in range(steps):
        state.step()
        potential.append(state.energies().potential)
        total.append(potential[-1] + 0.5 * float(mass @ (state.velocity.numpy() ** 2).sum(axis=1)))
    return potential, total


@pytest.mark.parametrize("shear", [200.0, 20.0])
@pytest.mark.parametrize(("shape", "resolution"), [("saddle", 17), ("hemisphere", 17), ("dome", 33)])
def test_any_time_step_reaches_the_same_minimum_and_never_more_energy_than_at_the_start(shape, resolution, shear):
    """The paper's Fig. 4."""
    network, start = developed(make_shape(shape, resolution=resolution), shear)
    least = relax_by_steps(Relaxation(network, TIGHT, start=start)).energies.potential
    steps = 400 if resolution == 17 else 550
    for time_step in (1e-4, 1e-3, 1.0, 1e4) if resolution == 17 else (1e-4, 1e4):
        potential, total = run(network, start, time_step=time_step, damped=True, steps=steps)
        assert max(total) <= total[0] * (1 + 1e-12)
        assert last_step_off(potential, least) < steps, f"h = {time_step:g} s"


@pytest.mark.parametrize(("shape", "shear"), [("dome", 200.0), ("saddle", 20.0), ("hemisphere", 20.0)])
def test_so_does_the_plain_iteration_in_more_steps(shape, shear):
    network, start = developed(make_shape(shape, resolution=17), shear)
    least = relax_by_steps(Relaxation(network, TIGHT, start=start)).energies.potential
    for time_step, steps in ((1e-4, 4000), (1e-2, 1500), (1e4, 1500)):
        potential, total = run(network, start, time_step=time_step, damped=False, steps=steps)
        assert max(total) <= total[0] * (1 + 1e-12)
        assert potential[-1] == pytest.approx(least, rel=1e-3), f"h = {time_step:g} s"


def test_kinetic_damping_saves_steps():
    network, start = developed(make_shape("dome", resolution=17), 200.0)
    least = relax_by_steps(Relaxation(network, TIGHT, start=start)).energies.potential
    taken = {
        damped: last_step_off(run(network, start, time_step=0.01, damped=damped, steps=1500)[0], least)
        for damped in (True, False)
    }
    assert taken[True] < 0.5 * taken[False]


# --- known patterns


def known_pattern(shape: str, surface: Surface, columns: int, rows: int) -> FloatArray:
    """#V by 2, the flat pieces of the formulas as they are meshed: the facets between their generators laid side by side."""
    p = surface.vertices.reshape(rows, columns, 3)
    across = np.linalg.norm(np.diff(p, axis=1), axis=2)
    if shape == "cone":
        apex = np.array([0.0, 0.4 * 0.25 / (0.25 - 0.10), 0.0])
        slant = np.linalg.norm(p - apex, axis=2)
        angle = np.cumsum(2 * np.arcsin(across[0] / 2 / slant[0, 0]))
        angle = np.concatenate([[0.0], angle]) - angle[-1] / 2
        return (slant[..., None] * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)).reshape(-1, 2)
    up = np.linalg.norm(np.diff(p, axis=0), axis=2)
    x = np.concatenate([[0.0], np.cumsum(across[0])])
    y = np.concatenate([[0.0], np.cumsum(up[:, 0])])
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
@pytest.mark.parametrize("shape", ["cylinder", "cone", "strip"])
def test_a_developable_piece_comes_back_to_its_known_pattern(shape: str, triangles: bool):
    """From its development, and from a layout pressed out of shape."""
    columns, rows = (13, 13) if shape != "strip" else (9, 33)
    surface = make_shape(shape, resolution=rows, triangles=triangles)
    known = known_pattern(shape, surface, columns, rows)
    size = np.ptp(known, axis=0)
    wave = np.sin(2.1 * np.pi * (known - known.min(axis=0)) / size)
    pressed = known * [0.93, 1.05] + 0.02 * size.min() * wave[:, ::-1]
    # the mean force of a spring counts as no less than that of a strain of 1e-9
    options = RelaxOptions(residual_tolerance=1.0, energy_tolerance=1.0, max_steps=50_000)
    edges = mesh_edges(surface.faces)
    in_space = np.linalg.norm(np.diff(surface.vertices[edges], axis=1)[:, 0], axis=1)
    for start in (developed(surface, 200.0)[1], pressed):
        network = SpringNetwork.build(surface, cloth(200.0), start, device=DEVICE)
        state = Relaxation(network, options, start=start)
        while not state.energies().potential <= state.negligible_energy:
            assert relax_by_steps(state).steps > 0
            assert state.steps < options.max_steps
        in_plane = np.linalg.norm(np.diff(state.positions()[edges], axis=1)[:, 0], axis=1)
        np.testing.assert_allclose(in_plane, in_space, rtol=1e-6)
        np.testing.assert_allclose(laid_upon(known, state.positions()), known, atol=1e-6 * size.max())


# --- the driver


def test_a_repeat_is_equal_bit_for_bit():
    surface = make_shape("hemisphere", resolution=13, triangles=True)
    ends = []
    for _ in range(2):
        network, start = developed(surface, 20.0)
        state = Relaxation(network, RelaxOptions(), start=start)
        outcome = relax_by_steps(state)
        ends.append((state.positions().tobytes(), state.velocity.numpy().tobytes(), outcome.steps, outcome.energies))
    assert ends[0] == ends[1]


def test_a_run_into_its_step_limit_says_so_and_can_go_on():
    network, start = developed(make_shape("dome", resolution=17), 200.0)
    state = Relaxation(network, RelaxOptions(max_steps=13, check_every=5), start=start)
    checks: list[int] = []
    outcome = relax_by_steps(state, watch=lambda s: checks.append(s.steps))
    assert not outcome.converged
    assert outcome.steps == state.steps == 13
    assert checks == [5, 10, 13]
    assert outcome.residual > state.options.residual_tolerance
    state.options = RelaxOptions()
    on = relax_by_steps(state)
    assert on.converged
    assert on.steps == state.steps - 13
    straight = Relaxation(network, RelaxOptions(check_every=1, max_steps=state.steps), start=start)
    for _ in range(state.steps):
        straight.step()
    assert np.array_equal(straight.positions(), state.positions())


def test_callbacks_come_after_every_step_and_every_look():
    network, start = developed(make_shape("saddle", resolution=9), 200.0)
    state = Relaxation(network, RelaxOptions(check_every=7), start=start)
    checks: list[tuple[int, float, float]] = []
    steps: list[tuple[int, float]] = []
    outcome = relax_by_steps(
        state,
        watch=lambda s: checks.append((s.steps, s.status.energies.potential, s.status.residual)),
        each_step=lambda s: steps.append((s.steps, s.status.energies.potential)),
    )
    assert [number for number, _ in steps] == list(range(1, outcome.steps + 1))
    assert [number for number, _, _ in checks] == list(range(7, outcome.steps + 1, 7))
    # between checks the last look's energy stands
    assert steps[7][1] == steps[12][1] == checks[0][1]
    assert checks[-1][1:] == (outcome.energies.potential, outcome.residual)


def test_convergence_asks_for_the_energy_and_for_the_residual():
    """Eq. (11) alone would stop at the first turning point."""
    network, start = developed(make_shape("dome", resolution=17), 20.0)
    by_energy = relax_by_steps(
        Relaxation(network, RelaxOptions(energy_tolerance=1e-4, residual_tolerance=1e3, check_every=1), start=start)
    )
    by_both = relax_by_steps(Relaxation(network, RelaxOptions(energy_tolerance=1e-4, check_every=1), start=start))
    assert by_energy.converged
    assert by_both.converged
    assert by_both.residual <= 5e-3 < by_energy.residual
    assert by_both.energies.potential < by_energy.energies.potential


def test_the_residual_is_the_largest_force_over_the_mean_force_of_a_spring():
    network, start = developed(make_shape("dome", resolution=9), 200.0)
    state = Relaxation(network, RelaxOptions(), start=start)
    state.step()
    s = network.spring_arrays
    moved = state.positions()
    length = np.linalg.norm(moved[s.ends[:, 1]] - moved[s.ends[:, 0]], axis=1)
    mean = (s.stiffness * np.abs(length - s.rest_length)).mean()
    # the force is that at the start of the step
    by_hand = np.linalg.norm(springs_and_guard(network, start)[1], axis=1).max() / mean
    assert state.residual() == pytest.approx(by_hand, rel=1e-9)


def test_a_layout_without_strain_is_at_rest_at_once():
    network, start = developed(make_shape("cylinder", resolution=9), 200.0)
    state = Relaxation(network, RelaxOptions(), start=start)
    outcome = relax_by_steps(state)
    assert outcome.converged
    assert outcome.steps == 0
    np.testing.assert_array_equal(state.positions(), start)


def test_a_layout_whose_energy_is_negligible_is_at_rest_whatever_rounding_leaves_of_the_forces():
    network, start = developed(make_shape("cylinder", resolution=9), 200.0)
    state = Relaxation(network, RelaxOptions(residual_tolerance=1e-12, max_steps=100), start=start)
    outcome = relax_by_steps(state)
    assert outcome.converged
    assert outcome.steps == 0
    assert outcome.residual > 1e-12


def test_but_not_while_a_seam_pulls_at_it():
    network, start = developed(make_shape("cylinder", resolution=9), 200.0)
    edges = network.spring_arrays.ends[:2]
    network.sew(edges.reshape(1, 4), np.array([1.1]), np.array([1e-6]))
    state = Relaxation(network, RelaxOptions(residual_tolerance=1e-12, max_steps=10), start=start)
    outcome = relax_by_steps(state)
    assert outcome.energies.potential < state.negligible_energy
    assert not outcome.converged


def test_a_state_without_a_step_left_says_what_its_forces_are():
    network, start = developed(make_shape("dome", resolution=9), 200.0)
    state = Relaxation(network, RelaxOptions(max_steps=10), start=start)
    relax_by_steps(state)
    outcome = relax_by_steps(state)
    assert outcome.steps == 0
    assert not outcome.converged
    state.evaluate_at_rest()
    assert outcome.residual == state.residual()
    assert math.isfinite(outcome.residual)


def test_the_middle_of_mass_stays_and_the_piece_does_not_run_away():
    network, start = developed(make_shape("dome", resolution=17), 200.0)
    state = Relaxation(network, RelaxOptions(kinetic_damping=False), start=start)
    for _ in range(300):
        state.step()
    mass = network.mass.numpy()
    drift = (mass @ (state.positions() - start)) / mass.sum()
    assert np.abs(drift).max() < 1e-2 * np.ptp(start)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("time_step", 0.0),
        ("time_step", math.nan),
        ("time_step", "fast"),
        ("energy_tolerance", -1e-9),
        ("residual_tolerance", 0.0),
        ("max_steps", 0),
        ("max_steps", True),
        ("check_every", 0),
    ],
)
def test_options_out_of_bounds_are_named(option: str, value: object):
    with pytest.raises(InputError, match=option) as refused:
        RelaxOptions(**{option: value}).validate()
    assert "\n" not in str(refused.value)


def test_a_start_of_another_mesh_is_refused():
    network, start = developed(make_shape("dome", resolution=9), 200.0)
    with pytest.raises(InputError, match=r"\(80, 2\); must be \(81, 2\)"):
        Relaxation(network, RelaxOptions(), start=start[:-1])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"max_steps": 1.5}, "max_steps = 1.5; must be a whole number between 1 and"),
        ({"check_every": 2.5}, "check_every = 2.5; must be a whole number between 1 and"),
        ({"kinetic_damping": "no"}, "kinetic_damping = 'no' is neither True nor False"),
    ],
)
def test_options_of_a_wrong_type_are_refused(options: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        RelaxOptions(**options).validate()  # type: ignore[arg-type]
