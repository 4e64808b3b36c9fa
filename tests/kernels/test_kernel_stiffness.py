"""Stiffnesses of the springs against NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE
from numpy.typing import NDArray
from small_networks import CLOTH
from test_kernel_unfold import SURFACES, norm

from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.springs import spring_geometry, springs_along_cells, springs_of
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.half_edges import half_edges
from warpflat.flat.surface.mesh import Surface

FloatArray = NDArray[np.float64]
QUADS = [name for name, make in SURFACES.items() if make().is_quad.all()]


def angles(d: FloatArray, warp: FloatArray) -> FloatArray:
    return np.arctan2(warp[0] * d[:, 1] - warp[1] * d[:, 0], d @ warp)


def stiffness(
    surface: Surface, fabric: Fabric, positions: FloatArray, grain_angle: float
) -> tuple[FloatArray, FloatArray]:
    """#S, face by face, and #F by 2, what long quads lack in shear: along their longer edges, the fourth root of it."""
    warp, _ = grain_axes(grain_angle)
    row = {(int(a), int(b)): e for e, (a, b) in enumerate(half_edges(surface.faces).edges)}
    k_ij, diagonals, lacks = np.zeros(len(row)), [], np.zeros((len(surface.faces), 2))
    quads, shear = positions[surface.faces], fabric.shear_stiffness
    first = angles(quads[:, 1] - quads[:, 0] + quads[:, 2] - quads[:, 3], warp)
    for number, (corner, off) in enumerate(zip(surface.faces, first, strict=True)):
        p, q = surface.vertices[corner], positions[corner]
        side = np.roll(p, -1, axis=0) - p
        rows = [row[min(a, b), max(a, b)] for a, b in zip(corner.tolist(), np.roll(corner, -1).tolist(), strict=True)]
        ka, kb = fabric.stiffness_warp, fabric.stiffness_weft
        if np.round(off / (np.pi / 2)) % 2 == 1:
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


@pytest.mark.parametrize("name", QUADS)
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
    assert lacks.any() or shear < 590.0 or name not in ("dome", "bodice")


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
    cells, network = make_cells(surface), SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2])
    springs, side = network.spring_arrays, springs_along_cells(spring_geometry(surface), cells)
    wished = np.stack([cells.corner, np.roll(cells.corner, -1, axis=1)], axis=-1).reshape(-1, 2)
    np.testing.assert_array_equal(np.sort(springs.ends[side], axis=1), np.sort(wished, axis=1))
