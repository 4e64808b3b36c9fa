"""The model: which mesh is what, cells and springs that store the fabric's energy, masses, the guard's onset."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from numpy.typing import NDArray
from scipy.spatial import Delaunay
from surface_meshes import quads_between
from warpflat.kernels.reduce import subtract
from warpflat.kernels.springs import compute_spring_energy

from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.model.membrane import Model, choose_model, plane_stress
from warpflat.flat.model.network import SpringNetwork, _repeated
from warpflat.flat.model.springs import springs_of, stretch_factor
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape


def cloth(*, warp: float = 1000.0, weft: float = 1000.0, shear: float = 200.0, nu: float = 0.0) -> Fabric:
    return Fabric(
        name="cloth",
        stiffness_warp=warp,
        stiffness_weft=weft,
        shear_stiffness=shear,
        areal_density=0.15,
        poisson_ratio=nu,
    )


def sheet(columns: int, rows: int, hx: float, hy: float, *, split: int = 0) -> Surface:
    """A rectangle of quads in the plane z = 0, the first `split` of them cut into two triangles."""
    x, y = np.meshgrid(hx * np.arange(columns + 1), hy * np.arange(rows + 1))
    quads = quads_between(x.shape)
    none = np.full((split, 1), -1)
    halves = [np.hstack([quads[:split][:, corners], none]) for corners in ([0, 1, 2], [0, 2, 3])]
    faces = np.concatenate([quads[split:], *halves])
    return make_surface(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)


def irregular(kind: str) -> Surface:
    """Some 900 faces in the plane, far from regular, sheared and turned."""
    random = np.random.default_rng(7)
    points = random.uniform(-0.2, 0.2, (480, 2)) * ([1.0, 0.05] if kind == "needles" else [1.0, 1.0])
    faces = Delaunay(points).simplices if kind in ("irregular", "needles") else None
    if faces is None:
        even = sheet(30, 30, 0.012, 0.014, split=300 if kind == "mixed" else 0)
        points, faces = even.vertices[:, :2] + random.uniform(-2e-3, 2e-3, (961, 2)), even.faces
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    points = points @ (turn @ [[1.0, 0.4], [0.0, 1.0]]).T
    return make_surface(np.column_stack([points, np.zeros(len(points))]), faces)


def spring_energy(network: SpringNetwork, positions: NDArray[np.float64]) -> float:
    energy = wp.zeros(network.vertex_count, dtype=wp.float64, device=DEVICE)
    at = wp.array(positions, dtype=wp.vec2d, device=DEVICE)
    count = network.vertex_count
    wp.launch(compute_spring_energy, dim=count, inputs=[at, network.springs, 0], outputs=[energy], device=DEVICE)
    return float(energy.numpy().sum())


def energy_of_strain(network: SpringNetwork, strain: NDArray[np.float64]) -> float:
    """Energy per strain squared in the limit of small strain (2 by 2): both signs averaged, and extrapolated."""
    flat = network.surface.vertices[:, :2]

    def both_signs(size: float) -> float:
        moved = (flat + size * flat @ strain, flat - size * flat @ strain)
        return sum(spring_energy(network, np.ascontiguousarray(p)) for p in moved) / (2 * size**2)

    size = 2e-3
    coarse, middle, fine = both_signs(size), both_signs(size / 2), both_signs(size / 4)
    first, second = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
    return (16 * second - first) / 15


STRAINS = {
    "weft": [[1.0, 0.0], [0.0, 0.0]],
    "warp": [[0.0, 0.0], [0.0, 1.0]],
    "both": [[1.0, 0.0], [0.0, 1.0]],
    "opposite": [[1.0, 0.0], [0.0, -0.7]],
    "shear": [[0.0, 0.5], [0.5, 0.0]],
    "all": [[0.6, 0.25], [0.25, -0.4]],
}


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize(("hx", "hy"), [(0.01, 0.01), (0.013, 0.01), (0.01, 0.017)])
@pytest.mark.parametrize(("warp", "weft", "shear"), [(1000, 1000, 200), (1000, 1000, 20), (1400, 600, 150)])
def test_a_rectangle_under_uniform_strain_stores_the_membranes_energy(strain, hx, hy, warp, weft, shear):
    """1/2 (C11 exx^2 + C22 eyy^2 + 2 C12 exx eyy + C66 gamma^2) A, with C12 = C66 = G as in any crossed lattice."""
    surface = sheet(6, 4, hx, hy)
    network = SpringNetwork.build(
        surface, cloth(warp=warp, weft=weft, shear=shear), surface.vertices[:, :2], device=DEVICE
    )
    assert network.spring_arrays.shear_deficit is None
    e = np.array(STRAINS[strain])
    exx, eyy, gamma = e[0, 0], e[1, 1], 2 * e[0, 1]
    density = 0.5 * (weft * exx**2 + warp * eyy**2 + 2 * shear * exx * eyy + shear * gamma**2)
    assert energy_of_strain(network, e) == pytest.approx(density * 24 * hx * hy, rel=1e-9)


@pytest.mark.parametrize("kind", ["irregular", "needles", "mixed", "sheared quads"])
@pytest.mark.parametrize("grain_angle", [0.0, 20.0, 45.0, 80.0, -33.0])
@pytest.mark.parametrize("name", ["isotropic", "woven", "denim", "interlock", "power-net"])
def test_cells_store_the_fabrics_energy_under_any_strain(name: str, grain_angle: float, kind: str):
    """Any triangles and any quads, sheared and turned, the grain at any angle."""
    fabric, surface = find_fabric(name), irregular(kind)
    flat = surface.vertices[:, :2]
    network = SpringNetwork.build(surface, fabric, flat, grain_angle=grain_angle, model="membrane", device=DEVICE)
    along, across = grain_axes(grain_angle)
    axes = np.column_stack([along, across])
    c_warp, c_weft, c_cross = plane_stress(fabric)
    if not fabric.is_isotropic:
        # Tension follows its curve, from the first of its points on.
        c_warp, c_weft = (
            c + (curve[0][1] / curve[0][0] - k if curve else 0.0)
            for c, k, curve in (
                (c_warp, fabric.stiffness_warp, fabric.curve_warp),
                (c_weft, fabric.stiffness_weft, fabric.curve_weft),
            )
        )
    area = 0.5 * float(np.abs(network.cell_arrays.area).sum()) * 2.0
    for strain in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.8, 0.5, -0.6)):
        e_warp, e_weft, gamma = 1e-5 * np.array(strain)
        worn = axes @ np.array([[e_warp, 0.5 * gamma], [0.5 * gamma, e_weft]]) @ axes.T
        state = Relaxation(network, RelaxOptions(), start=flat @ np.linalg.inv(np.eye(2) + worn))
        density = c_warp * e_warp**2 + c_weft * e_weft**2 + 2 * c_cross * e_warp * e_weft
        density += fabric.shear_stiffness * gamma**2
        assert state.energies().potential == pytest.approx(0.5 * density * area, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "fabric", "grain_angle", "model"),
    [
        ("quads", "woven", 0.0, "springs"),
        ("quads", "woven", 7.0, "springs"),
        ("quads", "woven", 94.0, "springs"),
        ("quads", "woven", 8.0, "membrane"),
        ("quads", "isotropic", 30.0, "springs"),
        ("triangles", "isotropic", 0.0, "membrane"),
        ("mixed", "woven", 0.0, "membrane"),
        ("fan", "woven", 0.0, "membrane"),
    ],
)
def test_springs_are_the_cloth_of_quads_along_the_grain_only(kind: str, fabric: str, grain_angle: float, model: str):
    if kind == "fan":
        # Three quarters of a ring: on average its quads run along the grain, and few of them do.
        angle, radius = np.meshgrid(np.linspace(0.0, 1.5 * np.pi, 31), np.linspace(0.1, 0.2, 6))
        vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=-1).reshape(-1, 3)
        number = np.arange(angle.size).reshape(angle.shape)
        corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        surface = make_surface(vertices, np.stack(corners, axis=-1).reshape(-1, 4))
    else:
        surface = sheet(6, 5, 0.01, 0.01, split={"quads": 0, "mixed": 3, "triangles": 30}[kind])
    flat, cloth_of = surface.vertices[:, :2], find_fabric(fabric)
    assert choose_model("auto", surface, cloth_of, flat, grain_angle=grain_angle) == model
    assert choose_model("membrane", surface, cloth_of, flat, grain_angle=grain_angle) == "membrane"
    assert SpringNetwork.build(surface, cloth_of, flat, grain_angle=grain_angle, device=DEVICE).model == model
    if model == "membrane":
        with pytest.raises(InputError, match=r'"springs" needs quads along warp and weft; leave model out'):
            flatten(
                surface,
                fabric=fabric,
                grain_angle=grain_angle,
                datum=[0, 7, 14] if kind != "fan" else None,
                model="springs",
            )


@pytest.mark.parametrize("grain_angle", [0.0, 90.0, 180.0])
def test_the_grain_decides_which_edges_are_warp(grain_angle: float):
    surface = sheet(5, 5, 0.01, 0.01)
    network = SpringNetwork.build(
        surface,
        cloth(warp=1500.0, weft=500.0, shear=100.0),
        surface.vertices[:, :2],
        grain_angle=grain_angle,
        device=DEVICE,
    )
    along_x, along_y = (energy_of_strain(network, np.diag(d)) / (25e-4 / 2) for d in ((1.0, 0.0), (0.0, 1.0)))
    wanted = (1500.0, 500.0) if grain_angle == 90.0 else (500.0, 1500.0)
    assert (along_x, along_y) == pytest.approx(wanted, rel=1e-9)


def test_grain_axes_are_at_right_angles_with_the_warp_up():
    np.testing.assert_allclose(grain_axes(0.0), ([0, 1], [1, 0]), atol=1e-12)
    for angle in (17.0, 45.0, -120.0):
        warp, weft = grain_axes(angle)
        assert np.linalg.norm(warp) == pytest.approx(1.0)
        assert warp @ weft == pytest.approx(0.0, abs=1e-12)
        assert np.degrees(np.arctan2(-warp[0], warp[1])) == pytest.approx(angle)


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize(("hx", "hy"), [(0.05, 0.01), (0.01, 0.03)])
@pytest.mark.parametrize("grain_angle", [0.0, 90.0])
def test_long_cells_store_what_the_fabric_does_but_for_less_that_couples_its_threads(strain, hx, hy, grain_angle):
    """C11, C22 and C66 as on square ones; C12 is what their weaker shear springs have."""
    surface, fabric = sheet(3, 3, hx, hy), cloth(warp=1000.0, weft=700.0, shear=200.0)
    positions = surface.vertices[:, :2]
    network = SpringNetwork.build(surface, fabric, positions, grain_angle=grain_angle, device=DEVICE)
    assert network.spring_arrays.long_quads == 9
    assert (network.spring_arrays.stiffness > 0).all()
    along_y, along_x = (1000.0, 700.0) if grain_angle == 0.0 else (700.0, 1000.0)
    shear = fabric.shear_stiffness
    coupled = 0.95 * min(along_x * (hy / hx) ** 2, along_y * (hx / hy) ** 2, shear / 0.95)
    e = 1e-4 * np.array(STRAINS[strain])
    exx, eyy, gamma = e[0, 0], e[1, 1], 2 * e[0, 1]
    density = 0.5 * (along_x * exx**2 + along_y * eyy**2 + 2 * coupled * exx * eyy + shear * gamma**2)
    # The strain of the body, which the cloth follows: the other way round in the plane.
    state = Relaxation(network, RelaxOptions(), start=positions @ np.linalg.inv(np.eye(2) + e))
    assert state.energies().potential == pytest.approx(density * 9 * hx * hy, rel=1e-3)


@pytest.mark.parametrize("shear", [100.0, 375.0, 545.0])
@pytest.mark.parametrize("ratio", [0.4, 0.75, 1.0, 1.05, 1.3, 1.34, 1.6, 2.5])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_vertex_is_held_against_its_four_neighbours_however_long_the_quads(shear: float, ratio: float, axis: int):
    """A wave from vertex to vertex along rows and columns alike, in which no diagonal is strained: with a quarter of what the cloth
    itself holds it by."""
    surface, fabric = sheet(8, 8, 0.01, 0.01 * ratio), cloth(warp=1000.0, weft=1400.0, shear=shear)
    flat = np.ascontiguousarray(surface.vertices[:, :2])
    row, column = np.indices((9, 9))
    moved = flat.copy()
    moved[:, axis] += 1e-6 * (-1.0) ** (row + column).ravel()
    stored = {}
    models: tuple[Model, ...] = ("springs", "membrane")
    for model in models:
        network = SpringNetwork.build(surface, fabric, flat, device=DEVICE, model=model)
        stored[model] = Relaxation(network, RelaxOptions(), start=moved).energies().potential
    assert stored["springs"] > 0.24 * stored["membrane"]


def test_quads_held_against_waves_store_nothing_of_their_shape_strained_uniformly():
    """Trapezia, from 1.2 to 1.7 times as long as wide, at four tenths of K against waves."""
    x, y = np.meshgrid(np.linspace(-0.03, 0.03, 7), np.linspace(0.0, 0.09, 7))
    vertices = np.column_stack([(x * (1.0 + y)).ravel(), (y * (1.0 + 2.0 * x)).ravel(), 0.0 * x.ravel()])
    faces = quads_between((7, 7))
    surface, flat = make_surface(vertices, faces), np.ascontiguousarray(vertices[:, :2])
    network = SpringNetwork.build(surface, cloth(shear=375.0), flat, device=DEVICE)
    hourglass = network.spring_arrays.hourglass
    assert hourglass is not None
    assert hourglass.any(axis=1).sum() > 20
    turned = flat @ np.array([[0.8, 0.6], [-0.6, 0.8]]) @ np.diag([1.1, 0.9]) + [0.3, -0.2]
    for layout in (flat, turned):
        np.testing.assert_allclose(np.einsum("fk,fkd->fd", hourglass, layout[faces]), 0.0, atol=1e-12)


def test_an_isotropic_cloth_does_not_feel_the_grain():
    surface = make_shape("bodice", resolution=17)
    straight, aslant = (
        flatten(surface, fabric="isotropic", datum="centre", grain_angle=angle) for angle in (0.0, 30.0)
    )
    assert aslant.stages[-1].model_energy_j == pytest.approx(straight.stages[-1].model_energy_j, rel=1e-6)
    far = [np.linalg.norm(flat.positions - flat.positions[0], axis=1) for flat in (straight, aslant)]
    np.testing.assert_allclose(*far, atol=2e-5)


def test_rest_lengths_are_those_in_space_and_diagonals_go_over_the_unfolded_quad():
    surface = make_shape("cylinder", resolution=9)
    springs = springs_of(surface, cloth(), surface.vertices[:, :2])
    edges, diagonals = springs.ends[: springs.edge_count], springs.ends[springs.edge_count :]
    space = np.linalg.norm(surface.vertices[edges[:, 0]] - surface.vertices[edges[:, 1]], axis=1)
    np.testing.assert_allclose(springs.rest_length[: springs.edge_count], space, rtol=1e-12)
    assert len(diagonals) == 2 * len(surface.faces)
    chord, rise = 2 * 0.15 * np.sin(np.pi / 16), 0.05
    np.testing.assert_allclose(springs.rest_length[springs.edge_count :], np.hypot(chord, rise), rtol=1e-12)


def test_every_spring_once_with_positive_stiffness_and_the_sum_around_each_vertex():
    surface = make_shape("saddle", resolution=9)
    network = SpringNetwork.build(surface, cloth(), surface.vertices[:, :2], device=DEVICE)
    s = network.spring_arrays
    assert (s.stiffness > 0).all()
    assert len(np.unique(np.sort(s.ends, axis=1), axis=0)) == len(s.ends) == network.spring_count
    sums = np.bincount(s.ends.ravel(), np.repeat(s.stiffness, 2))
    stiffest = np.zeros(len(sums))
    np.maximum.at(stiffest, s.ends.ravel(), np.repeat(s.stiffness, 2))
    np.testing.assert_allclose(network.spring_stiffness.numpy(), sums + 0.5 * stiffest, rtol=1e-12)


@pytest.mark.parametrize("triangles", [False, True])
def test_masses_add_up_to_the_cloth_and_none_is_zero(triangles: bool):
    surface = make_shape("dome", resolution=9, triangles=triangles)
    cells = make_cells(surface)
    mass = SpringNetwork.build(surface, cloth(), surface.vertices[:, :2], device=DEVICE).mass.numpy()
    assert (mass > 0).all()
    assert mass.sum() == pytest.approx(0.15 * cells.area.sum(), rel=1e-12)
    shares = np.bincount(cells.corner.ravel(), np.repeat(0.15 * cells.area / 3.0, 3))
    np.testing.assert_allclose(mass, shares, rtol=1e-12)


def copied(arrays):
    """The same arrays in another place, so that nobody knows them for the surface's own."""
    values = {each.name: getattr(arrays, each.name) for each in fields(arrays)}
    return replace(
        arrays,
        **{name: np.array(v) for name, v in values.items() if isinstance(v, np.ndarray)},
        **{name: copied(v) for name, v in values.items() if is_dataclass(v)},
    )


@pytest.mark.parametrize("split", [0, 7, 25])
def test_networks_of_one_surface_share_what_no_fabric_changes(split: int):
    surface = sheet(5, 5, 0.01, 0.012, split=split)
    flat = surface.vertices[:, :2]
    one = SpringNetwork.build(surface, cloth(), flat, device="cpu")
    other = SpringNetwork.build(surface, cloth(warp=1700.0, shear=90.0), 1.1 * flat, grain_angle=40.0, device="cpu")
    for struct, names in (
        ("springs", ("offset", "neighbor", "rest_length")),
        ("cells", ("face", "first", "laid", "offset", "slot")),
    ):
        for name in names:
            assert getattr(getattr(one, struct), name).ptr == getattr(getattr(other, struct), name).ptr, name
    assert not np.allclose(one.spring_arrays.stiffness, other.spring_arrays.stiffness)
    for shared in (one.spring_arrays.listed_length, one.spring_arrays.around.neighbor, one.cell_arrays.laid):
        with pytest.raises(ValueError, match="read-only"):
            shared[:] = 0


@pytest.mark.parametrize("split", [0, 7, 25])
def test_a_network_of_other_arrays_lists_them_as_the_surfaces_own(split: int):
    surface = sheet(5, 5, 0.01, 0.012, split=split)
    network = SpringNetwork.build(surface, cloth(), surface.vertices[:, :2], device=DEVICE)
    other = replace(network, spring_arrays=copied(network.spring_arrays), cell_arrays=copied(network.cell_arrays))
    assert other.springs.neighbor.ptr != network.springs.neighbor.ptr
    for struct, names in (
        ("springs", ("offset", "neighbor", "rest_length", "stiffness")),
        ("cells", ("face", "first", "laid", "offset", "slot", "slack")),
    ):
        for name in names:
            one, two = getattr(getattr(network, struct), name), getattr(getattr(other, struct), name)
            np.testing.assert_array_equal(one.numpy(), two.numpy(), err_msg=name)
    np.testing.assert_array_equal(network.mass.numpy(), other.mass.numpy())


def test_a_network_of_longer_springs_and_larger_cells_has_these():
    surface = sheet(5, 5, 0.01, 0.012, split=7)
    network = SpringNetwork.build(surface, cloth(), surface.vertices[:, :2], device=DEVICE)
    s, c = network.spring_arrays, network.cell_arrays
    larger = replace(
        network,
        spring_arrays=replace(s, listed_length=1.5 * s.listed_length),
        cell_arrays=replace(c, laid=1.5 * c.laid),
    )
    for name, factor in (("rest_length", 1.5), ("stiffness", 1.0)):
        one, two = (getattr(n.springs, name).numpy() for n in (network, larger))
        np.testing.assert_allclose(two, factor * one, rtol=1e-12, err_msg=name)
    np.testing.assert_allclose(larger.cells.laid.numpy(), 1.5 * network.cells.laid.numpy(), rtol=1e-12)
    np.testing.assert_allclose(larger.mass.numpy(), 2.25 * network.mass.numpy(), rtol=1e-12)


def test_a_vector_is_stretched_by_its_components_and_one_of_no_length_not_at_all():
    longer = stretch_factor(
        np.array([[3.0, 4.0], [0.0, 2.0], [0.0, 0.0]]), np.array([[2.0, 1.0], [5.0, 1.5], [2.0, 2.0]])
    )
    np.testing.assert_allclose(longer, [np.sqrt(52.0) / 5.0, 1.5, 1.0])


def test_springs_weighed_anew_have_the_new_stiffness_at_both_ends():
    surface = sheet(4, 3, 0.01, 0.01, split=5)
    network = SpringNetwork.build(surface, cloth(), surface.vertices[:, :2], model="membrane", device=DEVICE)
    before, lists = network.spring_arrays.listed_stiffness.copy(), network.springs.stiffness.ptr
    sums = network.spring_stiffness.ptr
    wished = np.random.default_rng(2).uniform(1.0, 9.0, network.spring_count)
    network.update_stiffness(wished)
    assert (network.springs.stiffness.ptr, network.spring_stiffness.ptr) == (lists, sums)
    np.testing.assert_array_equal(network.spring_arrays.listed_stiffness, before)
    offset, neighbor = network.springs.offset.numpy(), network.springs.neighbor.numpy()
    between = {(int(i), int(j)): k for (i, j), k in zip(network.spring_arrays.ends, wished, strict=True)}
    for i in range(network.vertex_count):
        there, k_ij = (a[offset[i] : offset[i + 1]] for a in (neighbor, network.springs.stiffness.numpy()))
        assert (np.diff(there) > 0).all()
        assert k_ij.tolist() == [between.get((i, int(j)), between.get((int(j), i))) for j in there]
        assert network.spring_stiffness.numpy()[i] == pytest.approx(k_ij.sum() + 0.5 * k_ij.max(), rel=1e-12)


def test_the_guard_begins_where_the_shear_springs_lose_their_hold():
    surface = sheet(2, 2, 0.01, 0.01)
    network = SpringNetwork.build(
        surface, cloth(warp=1500.0, weft=500.0, shear=100.0), surface.vertices[:, :2], device=DEVICE
    )
    np.testing.assert_allclose([float(onset) for onset in network.guard.onset], [100 / 1500, 100 / 500])


def test_a_compressed_thread_kinks_beyond_the_onset_and_the_guard_holds_it():
    """The reason for the guard: the second derivative of the energy along a zigzag of the weft threads."""
    surface = sheet(12, 12, 0.01, 0.01)
    network = SpringNetwork.build(surface, cloth(shear=50.0), surface.vertices[:, :2], device=DEVICE)
    columns = np.arange(13 * 13) % 13
    zigzag = np.column_stack([np.zeros(169), 1e-5 * (-1.0) ** columns])

    def curvature(squeeze: float) -> float:
        flat = surface.vertices[:, :2] * [squeeze, 1.0]
        sides = [spring_energy(network, flat + sign * zigzag) for sign in (1, -1)]
        return (sum(sides) - 2 * spring_energy(network, flat)) / 1e-10

    onset = float(network.guard.onset[1])
    assert curvature(1 / (1 + 0.5 * onset)) > 0
    assert curvature(1 / (1 + 2.0 * onset)) < 0


def test_one_number_for_all_rows_stays_one_on_a_device():
    rows = _repeated(wp.array([[1.0, 2.0]], dtype=wp.vec2d, device=DEVICE), 5)
    assert rows.shape == (5,)
    assert rows.numpy().tolist() == [[1.0, 2.0]] * 5
    got = wp.zeros(5, dtype=wp.vec2d, device=DEVICE)
    launch_each(subtract, 5, [got, rows], [got], device=DEVICE)
    assert got.numpy().tolist() == [[-1.0, -2.0]] * 5
