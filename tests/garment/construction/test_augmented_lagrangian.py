"""Pieces under equations, by a factor: the equations' gradients, the end of plain steps, the chord of the datum."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from devices import DEVICE
from numpy.typing import NDArray
from warpflat.kernels.constraints import LENGTHS, LINEAR, STRAIGHT

from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.metric import equation_rows
from warpflat.flat.solver.options import RelaxOptions, Solver
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.constraints import FixedLength, Straight
from warpflat.garment.construction.sewing import sew
from warpflat.garment.construction.sewn import Sewn


def forces_of(network: SpringNetwork, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    return Relaxation(network, RelaxOptions(), start=positions).forces()


@pytest.mark.parametrize("kind", [LENGTHS, STRAIGHT, LINEAR], ids=["lengths", "straight", "linear"])
def test_the_gradients_of_the_equations_are_their_forces(kind: int):
    surface, random = make_shape("dome", resolution=5), np.random.default_rng(kind)
    flat = surface.vertices[:, :2] + random.normal(scale=1e-3, size=(25, 2))
    alone, sewn = (SpringNetwork.build(surface, find_fabric("isotropic"), flat, device=DEVICE) for _ in range(2))
    ends = np.array([[0, 1, 10, 11], [2, 20, 24, 2], [7, 12, 17, 18]], dtype=np.int32)
    stiffness, target = np.array([300.0, 500.0, 200.0]), np.array([0.01, -0.02, 0.03])
    coefficient = random.normal(size=(3, 4, 2)) if kind == LINEAR else None
    sewn.sew(
        ends, np.array([1.0, 1.2, 0.0]), stiffness, kind=np.full(3, kind), target=target, coefficient=coefficient,
        offset=np.array([0.004, -0.001, 0.002]),
    )  # fmt: skip
    assert sewn.seams is not None
    state = Relaxation(sewn, RelaxOptions(), start=flat)
    missed = sewn.seam_residuals(state.position) + sewn.seams.offset.numpy()
    gradient = (equation_rows(sewn, flat).T @ (np.sqrt(stiffness) * missed)).reshape(-1, 2)
    np.testing.assert_allclose(gradient, forces_of(alone, flat) - forces_of(sewn, flat), atol=1e-9)
    assert np.abs(gradient).max() > 0.1


def test_a_network_is_as_sewn_in_another_process():
    surface = make_shape("dome", resolution=5)
    flat = surface.vertices[:, :2].copy()
    sewn = SpringNetwork.build(surface, find_fabric("isotropic"), flat, device=DEVICE)
    sewn.sew(
        np.array([[0, 1, 10, 11], [7, 12, 17, 18]], dtype=np.int32), np.array([1.1, 0.0]), np.array([300.0, 200.0]),
        kind=np.array([LENGTHS, LINEAR]), target=np.array([0.01, 0.02]), coefficient=np.full((2, 4, 2), 0.3),
        offset=np.array([0.004, -0.001]),
    )  # fmt: skip
    sewn.keep_vertical(np.array([2, 7], dtype=np.int32))
    there = pickle.loads(pickle.dumps(sewn))
    np.testing.assert_array_equal(forces_of(there, flat), forces_of(sewn, flat))
    place = Relaxation(sewn, RelaxOptions(), start=flat).position
    assert there.seam_energy(place) == sewn.seam_energy(place) > 0.0
    np.testing.assert_array_equal(forces_of(there, flat)[[2, 7], 0], 0.0)


@pytest.fixture(scope="module")
def by_solver() -> dict[Solver, Sewn]:
    """A front with a straight side and a hem of a fixed length, by the factor and by plain steps."""
    piece = flatten(make_shape("bodice", resolution=9), datum="centre", fabric="isotropic", device=DEVICE)
    wished = [Straight(piece="bodice", line="left"), FixedLength(piece="bodice", line="bottom", length=0.5)]
    fine = {"energy_tolerance": 1e-9, "residual_tolerance": 2e-4}
    solvers: tuple[Solver, ...] = ("auto", "paper")
    return {
        solver: sew({"bodice": piece}, constraints=wished, options=RelaxOptions(solver=solver, **fine))
        for solver in solvers
    }


def test_the_factor_and_plain_steps_end_at_the_same_energy(by_solver: dict[Solver, Sewn]):
    quick, plain = by_solver["auto"], by_solver["paper"]
    assert quick.converged
    assert plain.converged
    assert quick.energy_after == pytest.approx(plain.energy_after, rel=1e-4)
    assert quick.energy_after > 1.01 * quick.energy_before


def test_the_chord_of_the_datum_stays_upright(by_solver: dict[Solver, Sewn]):
    piece = by_solver["auto"].pieces["bodice"]
    ends = piece.positions[piece.datum[[0, -1]]]
    assert abs(ends[1, 0] - ends[0, 0]) < 1e-12
    assert ends[1, 1] - ends[0, 1] > 0.3


def test_a_piece_that_lies_flat_without_strain_is_sewn_within_a_low_limit():
    """Of no energy there is no share that may be left: rounding errors were searched for four hundred steps."""
    piece, low = flatten(make_shape("cylinder"), device=DEVICE), RelaxOptions(max_steps=100)
    sewn = sew({"cylinder": piece}, constraints=[Straight(piece="cylinder", line="bottom")], options=low)
    assert sewn.converged
