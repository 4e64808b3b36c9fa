"""Straight lines, fixed lengths, symmetry, and what they cost."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import grain_axes
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.constraint_equations import smooth_equations
from warpflat.garment.construction.constraints import Constraint, FixedLength, Straight, Symmetric
from warpflat.garment.construction.sewing import sew
from warpflat.garment.construction.sewn import Sewn

FINE = RelaxOptions(energy_tolerance=1e-9, residual_tolerance=2e-4)


@pytest.fixture(scope="module")
def front() -> Flattening:
    return flatten(make_shape("bodice", resolution=13), datum="centre", fabric="woven")


@pytest.fixture(scope="module")
def leaning() -> Flattening:
    """A body that is not symmetric: the grid has a mirror image, the shape has none."""
    surface = make_shape("bodice", resolution=13)
    x, y, _ = surface.vertices.T
    moved = surface.vertices + np.column_stack([0.15 * x * (x > 0), 0.08 * x, 0.1 * (x > 0) * x * np.sin(9 * y)])
    return flatten(replace(surface, vertices=moved), datum="centre", fabric="woven")


def sewn(piece: Flattening, *constraints: Constraint, options: RelaxOptions | None = None) -> Sewn:
    return sew({piece.surface.name: piece}, constraints=constraints, options=options)


def is_sound(made: Sewn) -> bool:
    """Whether the constraints are kept and no face is flipped."""
    return made.converged and not any(piece.flipped_faces for piece in made.pieces.values())


def line(piece: Flattening, name: str) -> NDArray[np.float64]:
    return piece.positions[piece.surface.lines[name]]


def stray(points: NDArray[np.float64]) -> float:
    """Farthest from the chord [m]."""
    u = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    return float(np.abs((points - points[0]) @ [-u[1], u[0]]).max())


def lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(np.diff(points, axis=0), axis=1)


def test_a_line_becomes_straight_and_keeps_its_freedom_otherwise(front: Flattening):
    assert stray(line(front, "left")) > 3e-3
    made = sewn(front, Straight(piece="bodice", line="left"))
    assert is_sound(made)
    side = line(made.pieces["bodice"], "left")
    assert stray(side) < 1e-4
    slope = (side[-1] - side[0]) / np.linalg.norm(side[-1] - side[0])
    assert 0.02 < abs(slope[0]) < 0.5, "it leans as the piece wants it"
    assert made.cost > 0.0


@pytest.mark.parametrize("grain_angle", [0.0, 20.0])
@pytest.mark.parametrize("along", ["warp", "weft"])
def test_a_line_lies_along_a_thread(along: str, grain_angle: float):
    piece = flatten(make_shape("bodice", resolution=9), datum="centre", fabric="woven", grain_angle=grain_angle)
    name = "left" if along == "warp" else "bottom"
    made = sewn(piece, Straight(piece="bodice", line=name, along=along))  # type: ignore[arg-type]
    assert is_sound(made)
    warp, weft = grain_axes(grain_angle)
    points = line(made.pieces["bodice"], name)
    assert np.ptp(points @ (weft if along == "warp" else warp)) < 2e-4
    assert np.ptp(points @ (warp if along == "warp" else weft)) > 0.2


def test_edges_keep_their_lengths_on_the_body(front: Flattening):
    body = front.surface.vertices[front.surface.lines["bust"]]
    assert np.abs(lengths(line(front, "bust")) - lengths(body)).max() > 1e-3
    made = sewn(front, FixedLength(piece="bodice", line="bust"))
    assert is_sound(made)
    kept = line(made.pieces["bodice"], "bust")
    assert np.abs(lengths(kept) - lengths(body)).max() < 3e-5
    assert abs(lengths(kept).sum() - lengths(body).sum()) < 1e-4


def test_a_stated_length_is_shared_out_by_the_edges(front: Flattening):
    body = lengths(front.surface.vertices[front.surface.lines["top"]])
    made = sewn(front, FixedLength(piece="bodice", line="top", length=1.02 * body.sum()))
    assert is_sound(made)
    np.testing.assert_allclose(lengths(line(made.pieces["bodice"], "top")), 1.02 * body, atol=3e-5)


def test_an_edge_that_must_be_longer_finds_its_length_without_a_zigzag():
    """As fine as the mesh a zigzag would be nearly free: the cloth only shears for it."""
    piece = flatten(make_shape("bodice", resolution=25), datum="centre", fabric="woven")
    body = float(lengths(piece.surface.vertices[piece.surface.lines["bottom"]]).sum())
    made = sewn(piece, FixedLength(piece="bodice", line="bottom", length=1.06 * body))
    assert is_sound(made)
    points = line(made.pieces["bodice"], "bottom")
    assert lengths(points).sum() == pytest.approx(1.06 * body, abs=1e-4)
    bend = points[1:-1] - 0.5 * (points[:-2] + points[2:])
    assert np.linalg.norm(bend[1:-1] - 0.5 * (bend[:-2] + bend[2:]), axis=1).max() < 1e-3


def test_a_piece_becomes_its_own_mirror_image(front: Flattening, leaning: Flattening):
    grid = np.arange(169).reshape(13, 13)
    partner = np.empty(169, dtype=int)
    partner[grid] = grid[:, ::-1]

    def odd(piece: Flattening) -> float:
        axis = line(piece, "centre")[:, 0].mean()
        return float(np.abs(piece.positions[partner] * [-1, 1] + [2 * axis, 0] - piece.positions).max())

    assert odd(leaning) > 5e-3
    made = sewn(leaning, Symmetric(piece="bodice", line="centre"))
    assert is_sound(made)
    assert odd(made.pieces["bodice"]) < 1.5e-4
    assert np.ptp(line(made.pieces["bodice"], "centre")[:, 0]) < 1.5e-4
    assert made.cost > 0.0
    # A body that is symmetric has nothing to pay.
    held = sewn(front, Symmetric(piece="bodice", line="centre"))
    assert is_sound(held)
    assert abs(held.cost) < 1e-3 * made.cost


def test_a_piece_stays_in_its_place(front: Flattening):
    """Nothing holds it there: rounding decided where it came to rest."""
    made = sewn(front, FixedLength(piece="bodice", line="top", length=0.4))
    np.testing.assert_allclose(made.pieces["bodice"].positions.mean(axis=0), front.positions.mean(axis=0), atol=1e-12)


def test_constraints_that_contradict_each_other_are_not_called_kept(leaning: Flattening):
    """Edges of different lengths to either side of the axis cannot be mirror images."""
    asked = (FixedLength(piece="bodice", line="top"), Symmetric(piece="bodice", line="centre"))
    made = sew({"bodice": leaning}, constraints=asked)
    assert not made.converged
    assert not made.pieces["bodice"].converged
    # It ends by itself.
    assert made.steps < RelaxOptions().max_steps
    assert max(held.violation for held in made.constraints) > 1e-4


def test_prices_add_up_to_what_all_constraints_cost(leaning: Flattening):
    made = sewn(
        leaning,
        Straight(piece="bodice", line="bottom", along="weft"),
        FixedLength(piece="bodice", line="centre"),
        Symmetric(piece="bodice", line="centre"),
    )
    assert is_sound(made)
    assert made.cost > 1e-3
    assert sum(held.cost for held in made.constraints) == pytest.approx(made.cost, rel=0.1)
    assert [held.kind for held in made.constraints] == ["straight", "length", "symmetric"]


@pytest.mark.parametrize("along", ["free", "warp"])
def test_another_solver_finds_the_same_least_energy(along: Literal["free", "warp"]):
    """Sequential quadratic programming over all coordinates, with the constraints as exact equations, and the springs that keep the top
    smooth. A side along the warp says how the piece lies; otherwise the ends of its datum are held upright."""
    from scipy.optimize import minimize

    piece = flatten(make_shape("bodice", resolution=5), datum="centre", fabric="woven")
    top, side = (piece.surface.lines[name] for name in ("top", "left"))
    wanted = 1.02 * lengths(piece.surface.vertices[top])
    stated = FixedLength(piece="bodice", line="top", length=float(wanted.sum()))
    made = sewn(piece, stated, Straight(piece="bodice", line="left", along=along), options=FINE)
    assert is_sound(made)

    network, smooth = replace(piece.network), smooth_equations(top, piece.positions)
    hold = smooth.soft * max(network.fabric.stiffness_warp, network.fabric.stiffness_weft)
    network.sew(smooth.ends, smooth.ratio, hold, kind=smooth.kind, target=smooth.target)

    laid = made.pieces["bodice"].positions
    if along == "free":
        assert laid[piece.datum[-1], 0] == pytest.approx(laid[piece.datum[0], 0], abs=1e-12)

    def energy(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        state = Relaxation(network, FINE, start=x.reshape(-1, 2))
        stored = 0.5 * hold @ (smooth_equations(top, x.reshape(-1, 2)).target - smooth.target) ** 2
        return 1e3 * (state.energies().potential + stored), -1e3 * state.forces().ravel()

    def amiss(x: NDArray[np.float64]) -> NDArray[np.float64]:
        points = x.reshape(-1, 2)
        u = points[side[-1]] - points[side[0]]
        away = points[side[1:-1]] - points[side[0]]
        held = side if along == "warp" else piece.datum
        leans = points[held[-1], 0] - points[held[0], 0]
        return np.concatenate([lengths(points[top]) - wanted, away @ [-u[1], u[0]] / np.linalg.norm(u), [leans]])

    found = minimize(
        energy, made.pieces["bodice"].positions.ravel() + 1e-3, jac=True, method="SLSQP",
        constraints={"type": "eq", "fun": amiss}, options={"maxiter": 500, "ftol": 1e-9},
    )  # fmt: skip
    assert found.success
    least = Relaxation(piece.network, FINE, start=found.x.reshape(-1, 2)).energies().potential
    assert made.energy_after == pytest.approx(least, rel=1e-5)
    assert made.cost > 0.01 * made.energy_before


def test_the_same_run_gives_the_same_bits(front: Flattening):
    asked = (Straight(piece="bodice", line="left"), FixedLength(piece="bodice", line="bust"))
    first, second = (sewn(front, *asked) for _ in range(2))
    assert is_sound(first)
    np.testing.assert_array_equal(first.pieces["bodice"].positions, second.pieces["bodice"].positions)


@pytest.mark.parametrize(
    ("constraint", "message"),
    [
        (Straight(piece="bodise", line="left"), r"no piece 'bodise'; did you mean 'bodice'"),
        (Straight(piece="bodice", line="lefd"), r"piece 'bodice' has no line 'lefd'; did you mean 'left'"),
        (Symmetric(piece="bodice", line="left"), r"symmetric about left: the line has no faces on both sides"),
        (Symmetric(piece="bodice", line="quarter"), r"symmetric about quarter: the mesh is not its own mirror image"),
        (Straight(piece="bodice", line="ring"), r"ring straight: the line is closed"),
        (
            Straight(piece="bodice", line="left", along="warb"),  # type: ignore[arg-type]
            r"left straight along warb: did you mean 'warp'\? valid: free, warp, weft",
        ),
    ],
)
def test_what_cannot_be_asked_is_told_in_one_line(front: Flattening, constraint: Constraint, message: str):
    grid = np.arange(169, dtype=np.int32).reshape(13, 13)
    ring = np.concatenate([grid[2, 2:5], grid[3:5, 4], grid[4, 3:1:-1], grid[3:1:-1, 2]])
    network = replace(
        front.network,
        surface=replace(front.network.surface, lines={**front.surface.lines, "quarter": grid[:, 3], "ring": ring}),
    )
    with pytest.raises(InputError, match=message) as caught:
        sew({"bodice": replace(front, network=network)}, constraints=[constraint])
    assert "\n" not in str(caught.value)
