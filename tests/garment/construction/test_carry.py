"""Cloth carried between bodies, a body fitted inside cloth, and ease by level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import vertex_normals
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.construction.carry import carry, carry_points
from warpflat.garment.construction.level_ease import level_ease, widened
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body, rotation
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.scan_pose import ScanOptions
from warpflat.garment.mannequin.slicer import Slicer


def _person(first: float = 0.0, scale: float = 1.65) -> CommonBody:
    """Return a body of the model, its first shape so many standard deviations off the mean."""
    model = BodyModel.load()
    shape = np.zeros(len(model.shapes))
    shape[:2] = first
    straight = rotation(np.zeros((len(model.joints), 3)))
    low = scale * float(model.mean[: model.count, 1].min())
    person = Person(shape=shape, bend=straight, turn=np.eye(3), scale=scale, place=np.array([0.0, -low, 0.0]))
    return CommonBody(name="body", person=person, vertices=finer_body()[0] @ model.vertices(person))


def _tunic(body: CommonBody, off: float) -> Surface:
    """Return a tube around the trunk from below the hip to the bust, so far off the skin [m]."""
    turn, heights = (
        np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False),
        np.linspace(body.level("hip") - 0.06, body.level("bust") + 0.03, 24),
    )
    slicer = Slicer(body.vertices, finer_body()[1])
    rows = []
    for height in heights:
        points = max(
            (p.points for p in slicer.cut(np.array([0.0, 1.0, 0.0]), float(height))), key=lambda p: np.ptp(p[:, 2])
        )
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        way = points - middle
        wide = np.abs(way[:, 0]).max() + off, np.abs(way[:, 2]).max() + off
        rows.append(
            np.column_stack(
                [middle[0] + wide[0] * np.sin(turn), np.full(48, height), middle[2] + wide[1] * np.cos(turn)]
            )
        )
    corner = np.arange(23)[:, None] * 48
    a, b = corner + np.arange(48), corner + (np.arange(48) + 1) % 48
    faces = np.stack([a, b, b + 48, a + 48], axis=-1).reshape(-1, 4)
    return make_surface(np.concatenate(rows), faces, name="tunic", closed=True)


def _layers(surface: Surface) -> list:
    return [(surface.vertices, triangulate(surface.faces)[0].astype(np.int64))]


def test_cloth_on_the_same_body_stays_and_goes_with_a_body_that_is_moved():
    body = _person()
    tunic = _tunic(body, 0.02)
    same = carry(tunic, body.vertices, body.vertices, CommonBody.skin_triangles())
    assert np.abs(same - tunic.vertices).max() < 1e-6
    turn = rotation(np.array([[0.0, 0.7, 0.0]]))[0]
    moved = carry(tunic, body.vertices, body.vertices @ turn.T + [1.0, 0.2, -0.3], CommonBody.skin_triangles())
    assert np.abs(moved - (tunic.vertices @ turn.T + [1.0, 0.2, -0.3])).max() < 2e-3


def test_points_off_the_skin_keep_their_distance():
    body, other = _person(), _person(first=1.5, scale=1.7)
    triangles = finer_body()[1]
    normals = vertex_normals(body.vertices, triangles)
    # In places where the skin is smooth: the trunk.
    rows = np.flatnonzero((np.abs(body.vertices[:, 0]) < 0.1) & (np.abs(body.vertices[:, 1] - 1.0) < 0.15))
    points = body.vertices[rows] + 0.03 * normals[rows]
    moved, far = carry_points(points, normals[rows], body.vertices, other.vertices, triangles)
    assert np.median(far) == pytest.approx(0.03, abs=0.002)
    off = moved - other.vertices[rows]
    assert np.median(np.abs(np.linalg.norm(off, axis=1) - 0.03)) < 0.003


def test_a_form_carried_to_another_size_is_the_form_of_that_size():
    """The truth: the basic block that is made for the other size."""
    small, large = (body_of_size(20.0, size) for size in ("EU 36", "EU 42"))
    on_small, on_large = (body.form("basic_block") for body in (small, large))
    faces = np.concatenate([piece.grid_vertices[piece.surface.faces] for piece in on_small.pieces.values()])
    used, number = np.unique(faces, return_inverse=True)
    garment = make_surface(on_small.vertices[used], number.reshape(-1, 4), name="block", weld=False)
    assert len(garment.vertices) == len(used)
    before, after = (CommonBody.of_mannequin(body, name="") for body in (small, large))
    for body, mannequin in ((before, small), (after, large)):
        for level in ("bust", "waist", "hip"):
            assert body.level(level) == pytest.approx(mannequin.levels()[level].height, abs=0.002)
    wearer = after.in_pose_of(before)
    carried = np.zeros_like(on_small.vertices)
    carried[used] = carry(garment, before.vertices, wearer.vertices, CommonBody.skin_triangles())
    missed, grown = [], []
    for piece in on_small.pieces.values():
        for row in piece.edges.values():
            ids = piece.grid_vertices[row]
            lengths = [polyline_length(points[ids]) for points in (carried, on_large.vertices, on_small.vertices)]
            missed.append(abs(lengths[0] - lengths[1]))
            grown.append(abs(lengths[1] - lengths[2]))
    assert np.median(grown) > 0.01
    assert np.median(missed) < 0.003
    assert np.percentile(missed, 80) < 0.012


def test_a_hem_that_lies_in_a_plane_stays_in_one():
    body, other = _person(), _person(first=2.0)
    tunic = _tunic(body, 0.02)
    # A fold upon the hem would show.
    carried = carry(tunic, body.vertices, other.vertices, CommonBody.skin_triangles())
    for ring in (carried[:48], carried[-48:]):
        at = ring - ring.mean(axis=0)
        assert np.abs(at @ np.linalg.svd(at)[2][-1]).max() < 1e-6


def test_ease_is_measured_by_level_and_changed():
    body = _person()
    tunic = _tunic(body, 0.02)
    has = level_ease(body, _layers(tunic))
    assert list(has) == ["bust", "underbust", "waist", "hip"]
    asked = {level: girths[0] - girths[1] for level, girths in has.items()} | {"waist": 0.2}
    wider = _layers(tunic)
    for _ in range(2):
        wider = [(widened(body, wider, asked)[0], wider[0][1])]
    after = level_ease(body, wider)
    for level, girths in after.items():
        assert girths[0] - girths[1] == pytest.approx(asked[level], abs=0.003), level
    # A garment that is open in front goes around nothing.
    middle = tunic.vertices[wider[0][1]].mean(axis=1)
    opened = [(tunic.vertices, wider[0][1][(np.abs(middle[:, 0]) > 0.02) | (middle[:, 2] < 0.0)])]
    assert level_ease(body, opened) == {}


def test_a_tape_passes_by_sleeves():
    body = _person()
    tunic = _tunic(body, 0.02)
    # One section goes around trunk and arms, as where armholes reach below the bust.
    cape, arms = tunic.vertices.copy(), np.abs(body.vertices[:, 0]).max()
    out = np.abs(cape[:, 0]) > 0.6 * np.abs(cape[:, 0]).max()
    cape[out, 0] = np.sign(cape[out, 0]) * (arms + 0.02)
    whole = max(
        Slicer(cape, _layers(tunic)[0][1]).cut(np.array([0.0, 1.0, 0.0]), body.level("bust")), key=lambda s: s.length
    )
    around = level_ease(body, [(cape, _layers(tunic)[0][1])])["bust"][0]
    assert around < level_ease(body, _layers(tunic))["bust"][0] < whole.length - 0.3


def test_a_body_is_fitted_inside_a_garment():
    wearer = _person(first=0.7, scale=1.68)
    rows = (wearer.vertices[:, 1] > 0.75) & (wearer.vertices[:, 1] < 1.38)
    triangles = CommonBody.skin_triangles()[rows[CommonBody.skin_triangles()].all(axis=1)]
    used, corners = np.unique(triangles, return_inverse=True)
    shell = wearer.vertices[used] + 0.006 * vertex_normals(wearer.vertices, finer_body()[1])[used]
    found = CommonBody.inside(shell, corners.reshape(-1, 3), name="inside")
    for level in ("bust", "waist", "hip"):
        assert found.level(level) == pytest.approx(wearer.level(level), abs=0.035)
    trunk = np.isin(np.arange(len(wearer.vertices)), used)
    off = np.einsum("va,va->v", found.vertices - wearer.vertices, vertex_normals(wearer.vertices, finer_body()[1]))[
        trunk
    ]
    assert np.median(np.abs(off)) < 0.006


def test_a_scan_tells_how_it_came_upright():
    wearer = _person(first=0.5)
    # In centimetres, its head towards +z, facing -y.
    turned = 100.0 * wearer.vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0] + [30.0, 50.0, 7.0]
    found = CommonBody.of_scan(turned, finer_body()[1], name="scan", options=ScanOptions(unit="cm"))
    placed = turned @ found.turn + found.shift
    assert np.median(np.linalg.norm(placed - found.vertices, axis=1)) < 0.01
    assert found.level("waist") == pytest.approx(wearer.level("waist") - wearer.vertices[:, 1].min(), abs=0.012)


def test_a_body_stands_as_another_one_does():
    one, other = _person(), _person(first=1.0)
    raised = replace(one.person, bend=one.person.bend.copy())
    bend = np.zeros((len(BodyModel.load().joints), 3))
    bend[BodyModel.load().joints.index("upperarm01.L"), 2] = 0.5
    raised = replace(raised, bend=rotation(bend))
    first = replace(one, person=raised, vertices=finer_body()[0] @ BodyModel.load().vertices(raised))
    stands = other.in_pose_of(first)
    model = BodyModel.load()
    expected = replace(other.person, bend=raised.bend, place=stands.person.place)
    assert np.abs(stands.vertices - finer_body()[0] @ model.vertices(expected)).max() < 1e-6
    assert stands.vertices[:, 1].min() == pytest.approx(first.vertices[:, 1].min())
