"""Stiffnesses of the springs against NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE
from numpy.typing import NDArray
from small_networks import CLOTH
from test_kernel_unfold import SURFACES, norm

from warpflat.fabric.fabric import Fabric, grain_axes
from warpflat.model.network import SpringNetwork
from warpflat.model.springs import measure_buckling_stiffness, quad_stiffness, springs_along_cells, springs_of
from warpflat.surface.cells import make_cells
from warpflat.surface.half_edges import half_edges
from warpflat.surface.mesh import Surface

FloatArray = NDArray[np.float64]


def thread_stiffness(fabric: Fabric, angle: FloatArray) -> FloatArray:
    """[N/m] of a strip cut at `angle` [rad] from the warp: 1/K = c4/K_warp + s4/K_weft + s2 c2 (1/G - 2 nu/K_warp)."""
    c2, s2 = np.cos(angle) ** 2, np.sin(angle) ** 2
    mixed = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
    return 1.0 / (c2 * c2 / fabric.stiffness_warp + s2 * s2 / fabric.stiffness_weft + s2 * c2 * mixed)


def angles(d: FloatArray, warp: FloatArray) -> FloatArray:
    return np.arctan2(warp[0] * d[:, 1] - warp[1] * d[:, 0], d @ warp)


def stiffness(
    surface: Surface, fabric: Fabric, positions: FloatArray, grain_angle: float
) -> tuple[FloatArray, FloatArray]:
    """#S, face by face, and #F by 2, what long quads lack in shear: along their longer edges, the fourth root of it."""
    warp, _ = grain_axes(grain_angle)
    row = {(int(a), int(b)): e for e, (a, b) in enumerate(half_edges(surface.faces).edges)}
    k_ij, diagonals, lacks = np.zeros(len(row)), [], np.zeros((len(surface.faces), 2))
    quads = positions[surface.faces[surface.is_quad]]
    first = angles(quads[:, 1] - quads[:, 0] + quads[:, 2] - quads[:, 3], warp)
    mean = float(np.angle(np.exp(4j * first).sum()) / 4.0)
    of_quad = iter(first)
    for number, face in enumerate(surface.faces):
        corner = face[face >= 0]
        p, q = surface.vertices[corner], positions[corner]
        side = np.roll(p, -1, axis=0) - p
        rows = [row[min(a, b), max(a, b)] for a, b in zip(corner.tolist(), np.roll(corner, -1).tolist(), strict=True)]
        if len(corner) == 3:
            area = 0.5 * norm(np.cross(side[0], side[1]))
            flat = angles(np.roll(q, -1, axis=0) - q, warp)
            k_ij[rows] += thread_stiffness(fabric, flat) * area / norm(side) ** 2
            continue
        ka, kb, shear = quad_stiffness(fabric, mean)
        if np.round((next(of_quad) - mean) / (np.pi / 2)) % 2 == 1:
            ka, kb = kb, ka
        a, b, _, _ = 0.5 * (norm(side) + norm(np.roll(side, -2, axis=0)))
        # What the diagonals take of the stiffness along the quad's edges leaves a twentieth of it.
        held = min(shear, 0.95 * ka * b**2 / a**2, 0.95 * kb * a**2 / b**2)
        half_a = 0.5 * (ka - held * a**2 / b**2) * b / a
        half_b = 0.5 * (kb - held * b**2 / a**2) * a / b
        k_ij[rows] += [half_a, half_b, half_a, half_b]
        diagonals.append(held * (a**2 + b**2) / (2.0 * a * b))
        edge = q[3] - q[0] + q[2] - q[1] if b > a else q[1] - q[0] + q[2] - q[3]
        lacks[number] = edge / np.linalg.norm(edge) * (shear - held) ** 0.25
    return np.concatenate([k_ij, diagonals, diagonals]), lacks


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize(("grain_angle", "shear"), [(0.0, 50.0), (30.0, 50.0), (80.0, 590.0)])
def test_stiffnesses_are_those_of_numpy(name: str, grain_angle: float, shear: float):
    made, fabric = SURFACES[name](), replace(CLOTH, shear_stiffness=shear)
    # No quad is square: of two directions that lack equally much either is right.
    surface = replace(made, vertices=made.vertices * [1.1, 1.0, 1.0])
    positions = surface.vertices[:, :2] + np.random.default_rng(7).normal(scale=1e-4, size=(len(surface.vertices), 2))
    # In a part of the piece, threads that run the other way.
    turned = surface.vertices[:, 1] > np.quantile(surface.vertices[:, 1], 0.7)
    positions[turned] = positions[turned] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    springs = springs_of(surface, fabric, positions, grain_angle=grain_angle)
    k_ij, lacks = stiffness(surface, fabric, positions, grain_angle)
    np.testing.assert_allclose(springs.stiffness, k_ij, rtol=1e-11)
    np.testing.assert_allclose(
        np.zeros_like(lacks) if springs.shear_deficit is None else springs.shear_deficit, lacks, atol=1e-11
    )
    assert lacks.any() or shear < 590.0 or name not in ("dome", "bodice", "mixed")


@pytest.mark.parametrize("name", SURFACES)
def test_springs_are_listed_around_each_vertex_as_a_sort_has_them(name: str):
    surface = SURFACES[name]()
    network = SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2], device=DEVICE)
    s = network.spring_arrays
    here, there = s.ends.T.ravel(), s.ends[:, ::-1].T.ravel()
    order = np.lexsort((there, here))
    count = np.bincount(here, minlength=network.vertex_count)
    np.testing.assert_array_equal(network.springs.offset.numpy(), np.append(0, np.cumsum(count)))
    np.testing.assert_array_equal(network.springs.neighbor.numpy(), there[order])
    for name, values in (("rest_length", s.rest_length), ("stiffness", s.stiffness)):
        np.testing.assert_array_equal(getattr(network.springs, name).numpy(), np.tile(values, 2)[order])


@pytest.mark.parametrize("name", ["triangles", "mixed", "dome"])
def test_each_side_of_a_cell_has_the_spring_between_its_ends(name: str):
    surface = SURFACES[name]()
    springs, cells = springs_of(surface, CLOTH, surface.vertices[:, :2]), make_cells(surface)
    side = springs_along_cells(springs, cells)
    wished = np.stack([cells.corner, np.roll(cells.corner, -1, axis=1)], axis=-1).reshape(-1, 2)
    np.testing.assert_array_equal(np.sort(springs.ends[side], axis=1), np.sort(wished, axis=1))


@pytest.mark.parametrize("name", ["triangles", "mixed", "dome"])
def test_hold_is_the_lower_quartile_of_what_springs_store_in_shear(name: str):
    surface = SURFACES[name]()
    positions, (warp, weft) = surface.vertices[:, :2] * [1.0, 0.9], grain_axes(20.0)
    springs, cells = springs_of(surface, CLOTH, positions, grain_angle=20.0), make_cells(surface)
    d = positions[springs.ends[:, 1]] - positions[springs.ends[:, 0]]
    share = (d @ warp) * (d @ weft) / (norm(d) ** 2)
    half = 0.5 * springs.stiffness * springs.rest_length**2 * share**2
    hold = np.bincount(springs.ends.ravel(), np.repeat(half, 2))
    hold /= np.bincount(cells.corner.ravel(), np.repeat(cells.area / 3.0, 3))
    hold[surface.faces[surface.is_quad].ravel()] = np.inf
    wished = 0.75 * np.sort(hold)[len(hold) // 4]
    assert measure_buckling_stiffness(surface, springs, positions, warp) == pytest.approx(wished, rel=1e-12)
    assert np.isfinite(wished) == (name == "triangles")
