"""Cloth at rest in space against closed forms: cylinders, a hanging strip, a cantilever."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from cloths import cloth_of, cylinder_body, cylinder_cloth, grid, sheet
from scipy.integrate import solve_bvp
from scipy.optimize import nnls
from warpflat.kernels.drape_contact import find_planes

from warpflat.garment.draping.body import Body
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.relax_drape import DrapedCloth, relax_drape
from warpflat.garment.draping.sewn_cloth import SewnCloth

RADIUS, HEIGHT, COLUMNS, ROWS = 0.12, 0.2, 17, 11


def on_cylinder(scale: float) -> tuple[SewnCloth, DrapedCloth]:
    """Cloth on a cylinder, its two straight sides held."""
    cloth = cylinder_cloth(cloth_of(), scale=scale, radius=RADIUS, height=HEIGHT, columns=COLUMNS, rows=ROWS)
    body = cylinder_body(radius=RADIUS, height=HEIGHT, columns=COLUMNS)
    held = np.isin(np.arange(len(cloth.designed)) % COLUMNS, (0, COLUMNS - 1))
    return cloth, relax_drape(cloth, body, held=held)


def weft_strain(cloth: SewnCloth, positions: np.ndarray) -> np.ndarray:
    """Per vertical strip and row."""
    ends = [points.reshape(-1, COLUMNS, points.shape[-1]) for points in (cloth.flat, positions)]
    lengths = [np.linalg.norm(np.diff(points, axis=1), axis=2) for points in ends]
    return lengths[1] / lengths[0] - 1.0


def test_the_exact_pattern_of_a_cylinder_lies_on_it():
    cloth, worn = on_cylinder(1.0)
    assert worn.converged
    assert worn.residual <= 5e-3
    gaps = cylinder_body(radius=RADIUS, height=HEIGHT, columns=COLUMNS).gaps(worn.positions)
    assert np.abs(gaps).mean() < 5e-5
    assert gaps.min() > -1e-6
    # Between its sides it sags as a sheared strip does, by w L^2 / 8 G.
    sag = cloth.designed[:, 1] - worn.positions[:, 1]
    weight = cloth.fabric.areal_density * 9.80665
    assert sag.max() == pytest.approx(weight * (np.pi * RADIUS) ** 2 / (8 * cloth.fabric.shear_stiffness), rel=0.1)


def test_a_pattern_that_is_too_narrow_presses_as_a_hoop_does():
    cloth, worn = on_cylinder(0.98)
    strain = 1.0 / 0.98 - 1.0
    assert worn.converged
    assert np.linalg.norm(worn.positions - cloth.designed, axis=1).max() < 2e-5
    np.testing.assert_allclose(weft_strain(cloth, worn.positions), strain, rtol=0.02)
    inner = np.zeros((ROWS, COLUMNS), dtype=bool)
    inner[2:-2, 2:-2] = True
    worn_area = cloth.vertex_areas() / 0.98
    pressure = (worn.pressing / worn_area)[inner.ravel()]
    np.testing.assert_allclose(pressure, cloth.fabric.stiffness_weft * strain / RADIUS, rtol=0.02)


def test_a_pattern_that_is_too_wide_lifts_off():
    cloth, worn = on_cylinder(1.02)
    assert np.linalg.norm(worn.positions - cloth.designed, axis=1).max() > 2e-3


def test_a_hanging_strip_stretches_by_its_own_weight():
    """Its end sinks by w g L^2 / 2 K."""
    length, rows = 1.0, 21
    x, y = (each.ravel() for each in np.meshgrid([0.0, 0.05, 0.1], np.linspace(0.0, length, rows)))
    fabric = cloth_of(stiffness_warp=120.0, stiffness_weft=120.0)
    cloth = sheet(np.column_stack([x, y]), np.column_stack([x, y, 0 * x]), grid(rows, 3), fabric)
    worn = relax_drape(cloth, None, held=y == length, options=DrapeOptions(tolerance=1e-4))
    assert worn.converged
    sunk = -worn.positions[y == 0.0, 1].mean()
    assert sunk == pytest.approx(fabric.areal_density * 9.80665 * length**2 / (2 * 120.0), rel=0.02)


def test_a_cantilever_bends_as_a_heavy_elastica_does():
    """Its bending length, the cube root of B / w, found from the tip's place by the elastica B a'' = -w (L - s) cos a.

    The strip is wide and stiff, for its free edges curl: bending one way and the other way across costs nothing.
    """
    rows, columns, spacing, bending = 9, 13, 0.005, 1e-5
    fabric = cloth_of(stiffness_warp=1500.0, stiffness_weft=1500.0, shear_stiffness=100.0, bending=bending)
    # Three rows are clamped: the last of them bends, so that the clamp is half a row before it.
    z = spacing * np.arange(-2, rows)
    x, y = (each.ravel() for each in np.meshgrid(spacing * np.arange(columns), z))
    cloth = sheet(np.column_stack([x, y]), np.column_stack([-x, 0 * x, y]), grid(rows + 2, columns), fabric)
    worn = relax_drape(cloth, None, held=y < 1e-9, options=DrapeOptions(tolerance=1e-3, max_steps=60_000))
    assert worn.converged
    tip = worn.positions[-columns:].mean(axis=0)
    weight, length = fabric.areal_density * 9.80665, (rows - 0.5) * spacing

    def angle_of_tip(stiffness: float) -> float:
        """The tip's angle below the level, seen from the clamp."""
        s = np.linspace(0.0, length, 41)
        found = solve_bvp(
            lambda s, a: np.array([a[1], -weight * (length - s) * np.cos(a[0]) / stiffness]),
            lambda a, b: np.array([a[0], b[1]]), s, np.zeros((2, 41)),
        )  # fmt: skip
        assert found.success
        slope = found.sol(s)[0]
        return float(np.arctan2(np.trapezoid(np.sin(slope), s), np.trapezoid(np.cos(slope), s)))

    stiffnesses = bending * np.linspace(0.8, 1.25, 10)
    angles = np.array([angle_of_tip(stiffness) for stiffness in stiffnesses])
    found = np.interp(np.arctan2(-tip[1], tip[2] + 0.5 * spacing), angles[::-1], stiffnesses[::-1])
    assert (found / bending) ** (1 / 3) == pytest.approx(1.0, rel=0.02)


def test_a_drape_is_repeated_bit_for_bit(monkeypatch: pytest.MonkeyPatch):
    results = []
    for threads in ("1", "3"):
        monkeypatch.setenv("WARPFLAT_THREADS", threads)
        cloth = cylinder_cloth(cloth_of(), scale=1.02, radius=RADIUS, height=HEIGHT, columns=33, rows=33)
        body = cylinder_body(radius=RADIUS, height=HEIGHT, columns=33)
        held = np.arange(len(cloth.designed)) % 33 == 0
        results.append(relax_drape(cloth, body, held=held, options=DrapeOptions(max_steps=200)))
    np.testing.assert_array_equal(results[0].positions, results[1].positions)
    assert results[0].steps == results[1].steps == 200
    assert not results[0].converged


def test_what_passes_to_the_other_side_of_a_groove_lies_in_a_ball_between_both():
    wall, radius = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2], [0.1, 0.1, 0.2], [0.1, 0.1, 0.0]]), 0.02
    faces = np.array([[0, 1, 2, 3], [7, 6, 5, 4]], dtype=np.int32)
    groove = Body(np.concatenate([wall, wall * [-1.0, 1.0, 1.0]]), faces, device=wp.get_device("cpu"))
    centre, normal = (wp.zeros(2, wp.vec3d, device="cpu") for _ in range(2))
    ball, found = wp.zeros(2, wp.float64, device="cpu"), []
    # The first one passes over, the second one does not.
    for x in (0.008, -0.008):
        at = wp.array([[x, 0.007, 0.1], [0.05, 0.049, 0.1]], dtype=wp.vec3d, device="cpu")
        inputs = [wp.uint64(groove.mesh.id), groove.normals, at, 0.1, radius, 0]
        wp.launch(find_planes, dim=2, inputs=inputs, outputs=[centre, normal, ball], device="cpu")
        found.append((ball.numpy().tolist(), normal.numpy().copy()))
    half = np.sqrt(0.5)
    assert [each for each, _ in found] == [[0.0, 0.0], [pytest.approx(radius), 0.0]]
    np.testing.assert_allclose(found[0][1], [[-half, half, 0.0]] * 2, atol=1e-6)
    np.testing.assert_allclose(found[1][1][1], [-half, half, 0.0], atol=1e-6)
    middle = centre.numpy()[0] + radius * normal.numpy()[0]
    np.testing.assert_allclose(middle, [0.0, radius / half, 0.1], atol=1e-5)


def test_the_ball_in_a_corner_of_three_sides_is_the_nearest_to_the_vertex_whichever_side_is_nearest():
    """Sides that lean by different angles. The nearest middle that all three leave free is found by least squares of no negative pushes."""
    rays = np.array([[1.0, 0.4, 0.0], [-0.4, 0.7, 0.9], [-0.6, 0.5, -0.9]])
    sides = [np.array([np.zeros(3), rays[(k + 1) % 3], rays[k]]) for k in range(3)]
    normals = np.array([np.cross(b, c) / np.linalg.norm(np.cross(b, c)) for _, b, c in sides])
    assert (normals[:, 1] > 0.0).all()
    corner = Body(np.concatenate(sides), np.arange(9, dtype=np.int32).reshape(3, 3), device=wp.get_device("cpu"))
    radius, count = 0.02, 40
    # On the skin all around the corner, so near that each ball touches at least two sides.
    at = np.random.default_rng(4).uniform(-0.006, 0.006, (count, 3))
    at[:, 1] = np.max(-(at[:, [0, 2]] @ normals[:, [0, 2]].T) / normals[:, 1], axis=1)
    nearest = np.abs(at @ normals.T).argmin(axis=1)
    assert set(nearest) == {0, 1, 2}
    free = np.linalg.solve(normals, (radius - at @ normals.T).T).T
    middles = at + np.array([nnls(normals.T, each)[0] for each in free]) @ normals
    centre, normal = (wp.zeros(count, wp.vec3d, device="cpu") for _ in range(2))
    ball = wp.full(count, radius, wp.float64, device="cpu")
    inputs = [wp.uint64(corner.mesh.id), corner.normals, wp.array(at, dtype=wp.vec3d), 0.1, radius, 0]
    wp.launch(find_planes, dim=count, inputs=inputs, outputs=[centre, normal, ball], device="cpu")
    np.testing.assert_array_equal(ball.numpy(), np.float32(radius))
    np.testing.assert_allclose(centre.numpy() + radius * normal.numpy(), middles, atol=1e-3 * radius)


def test_what_has_sunk_to_the_legs_has_fallen_off():
    """A tube twice as wide as the body: it is given up where its top comes to the legs, not 0.4 m below its place."""
    cloth = cylinder_cloth(cloth_of(), scale=2.0, radius=RADIUS, height=HEIGHT, columns=COLUMNS, rows=ROWS)
    body = cylinder_body(radius=RADIUS, height=10 * HEIGHT, columns=33)
    start = cloth.designed + 5 * HEIGHT * np.array([0.0, 1.0, 0.0])
    top = start[:, 1].max()
    fallen = relax_drape(cloth, body, start=start, legs=top - 0.05)
    assert fallen.fell_off
    assert top - 0.4 < fallen.positions[:, 1].max() < top - 0.05
    # What begins below the legs' level, as a stocking does, is not held there.
    assert relax_drape(cloth, body, start=start, legs=top + 0.05).positions[:, 1].max() < top - 0.4
