"""Arrays on a GPU are looked at there, with the results of the host's; without a GPU both are the host's own."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from devices import DEVICE

from warpflat.fabric.fabric import Fabric
from warpflat.fabric.library import find_fabric
from warpflat.flattening.flatten_piece import flatten
from warpflat.model.join import join_networks
from warpflat.model.network import SpringNetwork
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.options import RelaxOptions
from warpflat.solver.piece_sums_cpu import HostPieceSums
from warpflat.solver.piece_sums_cuda import DevicePieceSums
from warpflat.solver.relaxation import Relaxation
from warpflat.solver.steps_cuda import DeviceSteps
from warpflat.surface.shapes import make_shape

CLOTH = Fabric(name="cloth", stiffness_warp=900.0, stiffness_weft=700.0, shear_stiffness=90.0, areal_density=0.15)


def device_sums_of(state: Relaxation) -> tuple[DevicePieceSums, DeviceSteps]:
    pieces = DevicePieceSums(state.network, state._buffers)
    return pieces, DeviceSteps(state._buffers, pieces, damped=state.options.kinetic_damping)


@pytest.fixture
def on_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Relaxation, "_make_piece_sums", device_sums_of)


def state_of(sizes: list[int], held: list[int], device: str = DEVICE) -> Relaxation:
    """Pieces side by side that are strained, and move; some are held upright."""
    rng, parts, starts, alignments, first = np.random.default_rng(0), [], [], [], 0
    for size in sizes:
        surface = make_shape("dome", resolution=size)
        flat = flatten(surface, fabric=CLOTH, datum="centre", device="cpu").positions
        starts.append(1.05 * flat + rng.normal(scale=1e-5, size=flat.shape))
        parts.append(SpringNetwork.build(surface, CLOTH, starts[-1], device=device))
        column = surface.lines["centre"] + first
        alignments.append(
            GrainAlignment(lower=int(column[0]), upper=int(column[-1]), vertices=slice(first, first + len(flat)))
        )
        first += len(flat)
    start = np.concatenate(starts)
    turn = np.exp(0.3j)
    start = start @ np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])
    state = Relaxation(join_networks(parts), RelaxOptions(), start=start, alignments=[alignments[k] for k in held])
    state.velocity.assign(rng.normal(scale=1e-3, size=start.shape))
    state.load.assign(rng.normal(scale=1e-3, size=start.shape))
    state._buffers.evaluate.launch()
    return state


@pytest.mark.parametrize(("sizes", "held"), [([9], [0]), ([9, 17, 11], [0, 2]), ([9, 11], [])])
def test_what_is_looked_at(sizes: list[int], held: list[int]):
    one, other = state_of(sizes, held, "cpu"), state_of(sizes, held)
    host, device_sums = HostPieceSums(one.network, one._buffers), DevicePieceSums(other.network, other._buffers)
    assert host.vertex_ranges == device_sums.vertex_ranges
    for pieces, state in ((host, one), (device_sums, other)):
        state._buffers.measure_potential.launch()
        state.values = [*pieces.element_energies(), pieces.mirrored(), pieces.work_of_load(), pieces.force_norms()]
        state.values += [pieces.largest_forces(state.alignments), pieces.cloth_force()]
        state._buffers.measure_motion.launch()
        state.values.append(pieces.vertex_sums())
        pieces.hold_grain(state.alignments)
        state.values += [state.position.numpy(), state.velocity.numpy(), state.load.numpy()]
        state.values.append(pieces.damp() + pieces.take_stop_count())
        state.values += [state.velocity.numpy(), state._buffers.driving_force.numpy(), pieces.take_stop_count()]
    for expected, got in zip(one.values, other.values, strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-13)


def test_pieces_of_one_network_are_held_each():
    """As those of a garment, which are sewn together."""
    one, other = state_of([9, 17, 11], [0, 2], "cpu"), state_of([9, 17, 11], [0, 2])
    for state in (one, other):
        state.network.parts = ()
    host, device_sums = HostPieceSums(one.network, one._buffers), DevicePieceSums(other.network, other._buffers)
    assert host.vertex_ranges == device_sums.vertex_ranges == [slice(0, one.network.vertex_count)]
    np.testing.assert_allclose(
        device_sums.largest_forces(other.alignments), host.largest_forces(one.alignments), rtol=1e-10
    )
    host.hold_grain(one.alignments)
    device_sums.hold_grain(other.alignments)
    for name in ("position", "velocity", "load"):
        expected, got = (getattr(state, name).numpy() for state in (one, other))
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-13)


def test_parts_of_one_piece_are_held_each():
    """As where a cut has parted it: the vertices of a part have no range of their own."""
    one, other = state_of([9, 17], [0, 1], "cpu"), state_of([9, 17], [0, 1])
    own = np.arange(81, dtype=np.int32)
    parts = [
        GrainAlignment(lower=4, upper=76, vertices=own[own % 3 > 0], direction=(0.6, 0.8)),
        GrainAlignment(lower=0, upper=78, vertices=own[own % 3 == 0]),
    ]
    host, device_sums = HostPieceSums(one.network, one._buffers), DevicePieceSums(other.network, other._buffers)
    np.testing.assert_allclose(device_sums.largest_forces(parts), host.largest_forces(parts), rtol=1e-10)
    host.hold_grain(parts)
    device_sums.hold_grain(parts)
    for name in ("position", "velocity", "load"):
        expected, got = (getattr(state, name).numpy() for state in (one, other))
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-13)


def test_a_mirrored_cell_is_seen():
    state = state_of([9, 11], [])
    layout = state.positions()
    layout[100], layout[150] = layout[150], layout[100]
    state.position.assign(layout)
    state._buffers.evaluate.launch()
    assert DevicePieceSums(state.network, state._buffers).mirrored().tolist() == [False, True]


@pytest.mark.parametrize("steps", [1, 3, 70])
@pytest.mark.parametrize("check_interval", [1, 4])
def test_steps_are_the_same(steps: int, check_interval: int):
    one, other = state_of([9, 11], [0], "cpu"), state_of([9, 11], [0])
    other.piece_sums, other._device_steps = device_sums_of(other)
    for _ in range(4):  # recorded, and later a graph
        for state in (one, other):
            state.sweep(steps, check_interval=check_interval)
            state.velocity.zero_()
            state.smooth(min(steps, 4), check_interval=check_interval)
            state.evaluate_at_rest()
            state.smooth(2, check_interval=check_interval, evaluated=True)
        np.testing.assert_allclose(other.positions(), one.positions(), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(other.velocity.numpy(), one.velocity.numpy(), rtol=0.0, atol=1e-10)
    assert (one.steps, one.restarts) == (other.steps, other.restarts)
    assert steps < 70 or one.restarts > 0


def test_cycles_are_remembered_alike():
    rng = np.random.default_rng(6)
    stiffness = np.diag(rng.uniform(1.0, 5.0, 80))
    places = [rng.normal(size=(40, 2)) for _ in range(6)]
    forces = [-(stiffness @ place.ravel()).reshape(40, 2) for place in places]
    host, device_sums = SubspaceAcceleration(), SubspaceAcceleration()
    steps = np.zeros((40, 2)), wp.zeros(40, dtype=wp.vec2d, device=DEVICE)
    for memory, give, out in (
        (host, np.array, steps[0]),
        (device_sums, lambda of: wp.array(of, dtype=wp.vec2d, device=DEVICE), steps[1]),
    ):
        for k, (place, force) in enumerate(zip(places, forces, strict=True)):
            iterate = give(place), give(force)
            if k % 3 == 0:
                memory.begin_cycle(iterate)
            else:
                memory.add_iterate(iterate)
        assert memory.minimise_in_subspace(out)
    # Ways on the host are of single precision.
    np.testing.assert_allclose(steps[1].numpy(), steps[0], rtol=0.0, atol=1e-5 * np.abs(steps[0]).max())
    assert np.abs(steps[0]).max() > 0.1


@pytest.mark.parametrize("solver", ["multilevel", "plain"])
@pytest.mark.parametrize(
    ("shape", "triangles", "fabric"), [("dome", False, "woven"), ("bodice", True, "woven"), ("saddle", False, "silk")]
)
def test_pieces_come_to_the_same_rest(shape: str, triangles: bool, fabric: str, solver: str, on_device: None):
    surface = make_shape(shape, resolution=33, triangles=triangles)
    given = {"fabric": find_fabric(fabric), "datum": "centre", "relax": RelaxOptions(solver=solver)}
    piece = flatten(surface, device=DEVICE, **given)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            Relaxation, "_make_piece_sums", lambda state: (HostPieceSums(state.network, state._buffers), None)
        )
        expected = flatten(surface, device="cpu", **given)
    assert piece.converged
    assert piece.flipped_faces == 0
    assert piece.stages[-1].model_energy_j == pytest.approx(expected.stages[-1].model_energy_j, rel=1e-4)
