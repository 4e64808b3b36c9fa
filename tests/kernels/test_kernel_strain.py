"""Worn strain, stress and strain energy of single cells against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from small_networks import CLOTH, DEVICE, shaken, small_network, vec2
from warpflat.kernels.strain import compute_worn_strain

from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.model.membrane import make_cloth
from warpflat.flat.model.network import SpringNetwork


def worn(network: SpringNetwork, positions: NDArray[np.float64], *, pieces: int = 1) -> list[NDArray[np.float64]]:
    """Strain, stress, energy and area per cell."""
    count = network.cell_count
    outputs = [wp.zeros(count, dtype=t, device=DEVICE) for t in (wp.vec3d, wp.vec3d, wp.float64, wp.float64)]
    bounds = np.linspace(0, network.face_count, pieces + 1).astype(int)
    cloth = make_cloth(network.fabric, grain_axes(network.grain_angle), network.device, linear=True)
    for first, last in pairwise(bounds):
        wp.launch(
            compute_worn_strain,
            dim=int(last - first),
            inputs=[vec2(positions), network.cells, cloth, int(first)],
            outputs=outputs,
            device=DEVICE,
        )
    return [output.numpy() for output in outputs]


@pytest.mark.parametrize("grain_angle", [0.0, 45.0, 200.0])
def test_strain_of_a_shaken_layout(grain_angle: float):
    network = small_network(grain_angle=grain_angle)
    positions = shaken(network, scale=0.95)
    strain, stress, energy, area = worn(network, positions)
    warp, weft = grain_axes(grain_angle)
    nu, k_warp, k_weft = CLOTH.poisson_ratio, CLOTH.stiffness_warp, CLOTH.stiffness_weft
    # plane stress of an orthotropic sheet, from its compliance
    compliance = np.array(
        [[1 / k_warp, -nu / k_warp, 0], [-nu / k_warp, 1 / k_weft, 0], [0, 0, 1 / CLOTH.shear_stiffness]]
    )
    for c, (corner, weight) in enumerate(zip(network.cell_arrays.corner, network.cell_arrays.weight, strict=True)):
        body, flat = network.surface.vertices[corner], positions[corner]
        # the map of the flat cell into space, from which the tangent plane's axes drop out
        to_body = (body[1:] - body[0]).T @ np.linalg.inv((flat[1:] - flat[0]).T)
        along, across = to_body @ warp, to_body @ weft
        by_hand = [np.linalg.norm(along) - 1, np.linalg.norm(across) - 1, along @ across]
        np.testing.assert_allclose(strain[c], by_hand, atol=1e-12)
        np.testing.assert_allclose(compliance @ stress[c], by_hand, atol=1e-12)
        flat_area = 0.5 * np.linalg.det((flat[1:] - flat[0]).T) * weight
        assert area[c] == pytest.approx(flat_area, rel=1e-12)
        assert energy[c] == pytest.approx(0.5 * stress[c] @ strain[c] * flat_area, rel=1e-12)


SHEET = Fabric(
    name="sheet",
    stiffness_warp=800.0,
    stiffness_weft=800.0,
    shear_stiffness=800.0 / 2.6,
    areal_density=0.15,
    poisson_ratio=0.3,
)


@pytest.mark.parametrize("grain_angle", [0.0, 30.0])
def test_stress_of_an_isotropic_sheet_lies_along_its_principal_strains(grain_angle: float):
    assert SHEET.is_isotropic
    network = small_network(fabric=SHEET, grain_angle=grain_angle)
    positions = shaken(network, scale=0.95)
    _, stress, energy, area = worn(network, positions)
    axes = np.stack(grain_axes(grain_angle))
    for c, corner in enumerate(network.cell_arrays.corner):
        body, flat = network.surface.vertices[corner], positions[corner]
        to_body = (body[1:] - body[0]).T @ np.linalg.inv((flat[1:] - flat[0]).T)
        _, stretch, directions = np.linalg.svd(to_body, full_matrices=False)
        principal = 800.0 / (1.0 - 0.3**2) * np.array([[1.0, 0.3], [0.3, 1.0]]) @ (stretch - 1.0)
        tensor = axes @ directions.T @ np.diag(principal) @ directions @ axes.T
        np.testing.assert_allclose(stress[c], [tensor[0, 0], tensor[1, 1], tensor[0, 1]], atol=1e-9)
        assert energy[c] == pytest.approx(0.5 * principal @ (stretch - 1.0) * area[c], rel=1e-9)


def test_cloth_shorter_than_the_body_is_in_tension_when_worn():
    network = small_network()
    strain, stress, energy, _ = worn(network, shaken(network, scale=0.7, noise=0.0))
    assert (strain[:, :2] > 0).all()
    assert (stress[:, :2] > 0).all()
    assert (energy > 0).all()


def test_a_mirrored_or_collapsed_cell_says_so_by_its_area_and_has_no_strain():
    network = small_network()
    positions = shaken(network, scale=1.0, noise=0.0)
    positions[6] = positions[7]
    positions[2] = [-0.3, 0.05]
    strain, _, energy, area = worn(network, positions)
    lost = area <= 0
    assert (area < 0).any()
    assert (area == 0).any()
    assert not strain[lost].any()
    assert not energy[lost].any()
    assert np.isfinite(strain).all()


def test_pieces_of_a_launch_equal_the_whole():
    network = small_network()
    positions = shaken(network, scale=0.9)
    for whole, parts in zip(worn(network, positions), worn(network, positions, pieces=2), strict=True):
        assert np.array_equal(whole, parts)
