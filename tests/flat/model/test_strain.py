"""Worn strain per face, and the errors of a layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE

from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.model.membrane import Model
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import layout_errors, strain_energy, worn_strain
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.untangle import signed_cell_areas

CLOTH = Fabric(
    name="cloth",
    stiffness_warp=1000.0,
    stiffness_weft=600.0,
    shear_stiffness=50.0,
    areal_density=0.15,
    poisson_ratio=0.2,
)


def square(*, triangles: bool) -> Surface:
    """1 m by 1 m in four faces of equal size, or eight."""
    x, y = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    split = [[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads]
    return make_surface(points, split if triangles else quads)


def network_of(surface: Surface, grain_angle: float = 0.0) -> SpringNetwork:
    return SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2], grain_angle=grain_angle, device=DEVICE)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_uniform_strain_is_exact_on_any_mesh(triangles: bool):
    """Eqs. (1)-(3): a pattern smaller than the body by 5 % along warp and 2 % along weft, and sheared."""
    surface = square(triangles=triangles)
    to_body = np.array([[1.02, 0.06], [0.0, 1.05]])  # worn = to_body @ flat
    positions = surface.vertices[:, :2] @ np.linalg.inv(to_body).T
    worn = worn_strain(network_of(surface), positions)
    along, across = to_body[:, 1], to_body[:, 0]
    e = np.array([np.linalg.norm(along) - 1, np.linalg.norm(across) - 1, along @ across])
    np.testing.assert_allclose(worn.strain, np.tile(e, (len(surface.faces), 1)), atol=1e-12)
    nu_weft = 0.2 * 600 / 1000
    c_warp, c_weft = 1000 / (1 - 0.2 * nu_weft), 600 / (1 - 0.2 * nu_weft)
    stress = [c_warp * (e[0] + nu_weft * e[1]), c_weft * (e[1] + 0.2 * e[0]), 50 * e[2]]
    np.testing.assert_allclose(worn.stress, np.tile(stress, (len(surface.faces), 1)), atol=1e-9)
    np.testing.assert_allclose(worn.energy_density, 0.5 * np.dot(stress, e), rtol=1e-12)
    assert worn.area.sum() == pytest.approx(1 / np.linalg.det(to_body), rel=1e-12)
    assert worn.energy.sum() == pytest.approx(0.5 * np.dot(stress, e) * worn.area.sum(), rel=1e-12)


@pytest.mark.parametrize("model", ["springs", "membrane"])
def test_faces_have_the_mean_of_their_cells_by_area_and_their_energy_adds_up(model: Model):
    """Of a network whose law is linear, as springs are measured, or the membrane's."""
    flat = square(triangles=False)
    bent = flat.vertices + np.column_stack([np.zeros((9, 2)), 0.2 * np.sin(3 * flat.vertices[:, 0])])
    surface = make_surface(bent, [[0, 1, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    positions = bent[:, :2] * [1.0, 1.05] + 0.03 * np.random.default_rng(2).normal(size=(9, 2))
    network = replace(SpringNetwork.build(surface, CLOTH, positions, grain_angle=20.0, device=DEVICE), model=model)
    worn = worn_strain(network, positions)
    assert strain_energy(network, positions) == pytest.approx(worn.energy.sum(), rel=1e-12)
    assert worn.energy.sum() > 0
    cells = network.cell_arrays
    area = cells.weight * signed_cell_areas(cells.corner, positions)
    for face in range(len(surface.faces)):
        of_face = cells.face == face
        each = []
        for corner in cells.corner[of_face]:
            # alone, the cell is a triangle
            single = make_surface(surface.vertices[corner], [[0, 1, 2]])
            lone = SpringNetwork.build(single, CLOTH, positions[corner], grain_angle=20.0, device=DEVICE)
            each.append(worn_strain(replace(lone, model=model), positions[corner]))
        share = area[of_face] / area[of_face].sum()
        assert worn.area[face] == pytest.approx(area[of_face].sum(), rel=1e-12)
        np.testing.assert_allclose(worn.strain[face], share @ [lone.strain[0] for lone in each], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(worn.stress[face], share @ [lone.stress[0] for lone in each], rtol=1e-9, atol=1e-9)
        density = share @ [lone.energy_density[0] for lone in each]
        assert worn.energy_density[face] == pytest.approx(density, rel=1e-9)


def test_the_grain_turns_the_axes():
    surface = square(triangles=True)
    positions = surface.vertices[:, :2] * [1.0, 0.9]
    straight, turned = (worn_strain(network_of(surface, angle), positions).strain[0] for angle in (0.0, 90.0))
    np.testing.assert_allclose(straight, [1 / 0.9 - 1, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned, [0.0, 1 / 0.9 - 1, 0.0], atol=1e-12)
    bias = worn_strain(network_of(surface, 45.0), positions).strain[0]
    assert bias[0] == pytest.approx(bias[1])
    assert abs(bias[2]) == pytest.approx(0.5 * (1 / 0.81 - 1), rel=1e-12)


def test_a_face_of_no_area_has_no_density():
    surface = square(triangles=True)
    worn = worn_strain(network_of(surface), np.zeros((9, 2)))
    assert not worn.energy_density.any()
    assert not worn.area.any()


def test_a_crushed_face_counts_as_flipped_and_its_density_fits_a_film():
    surface = square(triangles=True)
    network = network_of(surface)
    for share in (1e-12, 1e-30, 1e-160):
        positions = share * surface.vertices[:, :2]
        density = worn_strain(network, positions).energy_density
        assert np.isfinite(density.astype(np.float32)).all()
        assert layout_errors(surface, network, positions).flipped_faces == len(surface.faces)
    assert layout_errors(surface, network, 0.01 * surface.vertices[:, :2]).flipped_faces == 0


def test_errors_are_those_of_their_definitions():
    surface = square(triangles=False)
    positions = surface.vertices[:, :2] * [0.9, 1.2]
    errors = layout_errors(surface, network_of(surface), positions)
    # six edges of half a metre each way
    assert errors.length_error == pytest.approx((6 * 0.05 + 6 * 0.1) / 6.0)
    assert errors.area_error == pytest.approx(0.08)
    assert errors.boundary_error == pytest.approx(0.05)
    assert errors.flipped_faces == 0


def test_length_errors_of_opposite_sign_do_not_cancel_and_those_of_the_border_do():
    surface = square(triangles=False)
    positions = surface.vertices[:, :2] * [0.8, 1.2]
    errors = layout_errors(surface, network_of(surface), positions)
    assert errors.length_error == pytest.approx(0.2)
    assert errors.boundary_error == pytest.approx(0.0, abs=1e-12)


def test_flips_count_faces_not_cells():
    surface = square(triangles=False)
    positions = surface.vertices[:, :2].copy()
    assert layout_errors(surface, network_of(surface), positions).flipped_faces == 0
    positions[0] = [0.4, 0.4]  # a dart's tip: the quad is no longer convex
    assert layout_errors(surface, network_of(surface), positions).flipped_faces == 1
    positions[:, 0] *= -1
    mirrored = layout_errors(surface, network_of(surface), positions)
    assert mirrored.flipped_faces == 4
    assert mirrored.area_error > 1.5


def test_signed_areas():
    corner = np.array([[0, 1, 2], [0, 2, 1], [0, 1, 1]], dtype=np.int32)
    positions = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(signed_cell_areas(corner, positions), [1.0, -1.0, 0.0])


def test_a_development_of_a_cylinder_has_no_error():
    surface = make_shape("cylinder", resolution=9)
    p = surface.vertices.reshape(9, 9, 3)
    chord = np.linalg.norm(p[0, 1] - p[0, 0])
    positions = np.stack([chord * np.tile(np.arange(9), 9), surface.vertices[:, 1]], axis=1)
    errors = layout_errors(surface, network_of(surface), positions)
    assert max(errors.length_error, errors.area_error, errors.boundary_error) < 1e-12
