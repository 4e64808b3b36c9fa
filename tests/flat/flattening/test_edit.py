"""Another fabric, and a surface that has moved: the minimum that flattening afresh finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from devices import DEVICE

from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.flattening.edit import change_fabric, change_surface
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.membrane import Model
from warpflat.flat.model.wear import Wear
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape


def cloth(shear: float) -> Fabric:
    return Fabric(name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=shear, areal_density=0.15)


def minimum(piece: Flattening) -> float:
    return piece.stages[-1].model_energy_j


def moved(surface: Surface) -> Surface:
    """The bust 5 mm higher and fuller, as a feature line that was moved would have it; read anew, so with faces of its own."""
    x, y, z = surface.vertices.T
    bump = np.exp(-(((y - 0.28) / 0.05) ** 2))
    vertices = np.column_stack([x * (1.0 + 0.03 * bump), y + 0.005 * bump, z * (1.0 + 0.05 * bump)])
    return replace(surface, vertices=vertices, input_vertices=vertices, name="fuller", faces=surface.faces.copy())


@pytest.mark.parametrize("triangles", [False, True])
def test_changing_the_fabric_gives_what_flattening_in_it_gives(triangles: bool):
    surface = make_shape("bodice", resolution=33, triangles=triangles)
    first = flatten(surface, fabric=cloth(375.0), datum="centre", device=DEVICE)
    stages: list[str] = []
    fabric = replace(cloth(250.0), name="softer cloth")
    changed = change_fabric(first, fabric, callback=lambda at: stages.append(at.stage))
    fresh = flatten(surface, fabric=fabric, datum="centre", device=DEVICE)
    assert changed.converged
    assert changed.flipped_faces == 0
    assert changed.fabric is fabric
    assert changed.stages[:-2] == first.stages
    assert changed.stages[-2].name == "steps"
    assert changed.stages[-1].name == "fabric:softer cloth"
    assert set(stages) == {"steps", "fabric:softer cloth"}
    energies = [piece.stages[-1].model_energy_j for piece in (changed, fresh, first)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-3)
    assert energies[0] < 0.95 * energies[2]
    with pytest.raises(InputError, match="fabric"):
        change_fabric(first, "no such cloth")


def apart(first: Flattening, second: Flattening) -> float:
    """By how much two patterns of one piece differ, at most, in whatever place they lie [m]."""
    way = first.positions - second.positions
    return float(np.linalg.norm(way - way.mean(axis=0), axis=1).max())


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
@pytest.mark.parametrize(("before", "after"), [("isotropic", "woven"), ("woven", "denim"), ("denim", "isotropic")])
def test_a_cloth_of_other_threads_gives_what_flattening_in_it_gives(before: str, after: str, triangles: bool):
    surface = make_shape("bodice", resolution=25, triangles=triangles)
    changed = change_fabric(flatten(surface, fabric=before, datum="centre", device=DEVICE), after)
    fresh = flatten(surface, fabric=after, datum="centre", device=DEVICE)
    assert changed.converged
    assert minimum(changed) == pytest.approx(minimum(fresh), rel=3e-3)
    assert apart(changed, fresh) < 2e-4


@pytest.mark.parametrize(("model", "triangles"), [("springs", False), ("membrane", False), ("membrane", True)])
@pytest.mark.parametrize(
    "wear",
    [Wear(stretch_weft=0.2), Wear(stretch_weft=0.6, stretch_warp=0.3), Wear(pressure=300.0)],
    ids=["weft", "both", "pressure"],
)
def test_a_tight_pattern_is_measured_where_it_lies(wear: Wear, model: Model, triangles: bool):
    """Threads are shortened along where they run in the end: a pattern that goes on in its own cloth stays."""
    surface = make_shape("bodice", resolution=25, triangles=triangles)
    first = flatten(surface, fabric="power-net", datum="centre", wear=wear, model=model, device=DEVICE)
    again = change_fabric(first, "power-net")
    assert first.converged
    assert minimum(again) == pytest.approx(minimum(first), rel=3e-3)
    assert apart(again, first) < 2e-4


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
@pytest.mark.parametrize("with_cut", [False, True], ids=["whole", "cut"])
def test_a_moved_surface_gives_what_flattening_it_afresh_gives(triangles: bool, with_cut: bool):
    surface = make_shape("bodice", resolution=33, triangles=triangles)
    plan = CutPlan(name="dart", paths=(np.arange(33 * 33, dtype=np.int32).reshape(33, 33)[:14, 10],))
    given = {"fabric": cloth(200.0), "datum": "centre", "device": DEVICE}
    first = flatten(surface, **given)
    first = cut(first, plan) if with_cut else first
    other, stages = moved(surface), set[str]()
    after = change_surface(first, other, callback=lambda at: stages.add(at.stage))
    fresh = flatten(other, **given)
    fresh = cut(fresh, plan) if with_cut else fresh
    assert after.converged
    assert after.flipped_faces == 0
    assert stages == {"steps", "surface:fuller"}
    assert after.stages[:-2] == first.stages
    assert minimum(after) == pytest.approx(minimum(fresh), rel=1e-3)
    assert abs(minimum(after) / minimum(first) - 1.0) > 0.1
    np.testing.assert_array_equal(after.surface.vertices, other.vertices)
    np.testing.assert_array_equal(after.network.surface.vertices, fresh.network.surface.vertices)
    assert [made.length for made in after.cuts] == [made.length for made in fresh.cuts]
    # What the faces alone tell is not worked out again, and nothing of the first result has changed.
    assert half_edges_of(after.network.surface) is half_edges_of(first.network.surface)
    assert first.surface is surface
    assert first.network.surface.vertices is not after.network.surface.vertices


@pytest.fixture(scope="module")
def dome() -> Flattening:
    return flatten(make_shape("dome", resolution=9), datum="centre", device=DEVICE)


def test_moved_vertices_alone_are_the_same_mesh(dome: Flattening):
    vertices = dome.surface.vertices * [1.0, 1.05, 1.0]
    after = change_surface(dome, vertices)
    whole = change_surface(dome, replace(dome.surface, vertices=vertices, input_vertices=vertices))
    np.testing.assert_array_equal(after.positions, whole.positions)
    np.testing.assert_array_equal(after.surface.vertices, vertices)
    np.testing.assert_array_equal(after.surface.input_vertices, vertices)
    assert after.stages[-1].name == "surface:dome"
    np.testing.assert_array_equal(change_surface(dome, vertices.tolist()).positions, whole.positions)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lambda v: v[:-1], r"piece 'dome' has 81 vertices, not 80: give them all"),
        (
            lambda v: v[:, :2],
            r"must be #V by 3, got an array of shape \(81, 2\); give a Surface, or its 81 vertices by 3",
        ),
        (lambda v: np.where(np.arange(81)[:, None] == 7, np.nan, v), r"vertex 7 .* not finite"),
        (lambda v: "dome.obj", r"vertices must be numbers"),
        (lambda v: None, r"#V by 3"),
    ],
)
def test_what_is_no_surface_is_told(dome: Flattening, given: Callable[[np.ndarray], Any], message: str):
    with pytest.raises(InputError, match=message):
        change_surface(dome, given(dome.surface.vertices))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("as_surface", [False, True], ids=["vertices", "surface"])
@pytest.mark.parametrize(
    ("collapse", "message"),
    [
        (
            lambda v, faces: v * 0.0,
            r"face 0 \(vertices 0, .*\) has collapsed to a line or a point \(and 63 more like it\)",
        ),
        (lambda v, faces: v * [1.0, 0.0, 0.0], r"face 0 .* has collapsed"),
        (
            lambda v, faces: np.where(np.isin(np.arange(len(v)), faces[20])[:, None], v[faces[20, 0]], v),
            r"face 12 \(vertices 13, 14, 23, 22\) has collapsed to a line or a point \(and 4 more like it\)",
        ),
    ],
)
def test_collapsed_faces_are_refused_by_name(dome: Flattening, collapse: Any, message: str, as_surface: bool):
    vertices = collapse(dome.surface.vertices, dome.surface.faces)
    with pytest.raises(InputError, match=message):
        change_surface(dome, replace(dome.surface, vertices=vertices) if as_surface else vertices)


@pytest.mark.parametrize("as_surface", [False, True], ids=["vertices", "surface"])
def test_quads_whose_sides_cross_are_refused_since_an_edit_cuts_no_faces(dome: Flattening, as_surface: bool):
    vertices = np.random.default_rng(0).random(dome.surface.vertices.shape)
    with pytest.raises(InputError, match=r"piece 'dome': face 4 \(.*\) has become a quad whose sides cross"):
        change_surface(dome, replace(dome.surface, vertices=vertices) if as_surface else vertices)


def test_the_note_on_a_chosen_datum_is_of_the_surface_as_it_is_now():
    first = flatten(make_shape("dome", resolution=9), device=DEVICE)
    after = change_surface(first, 1.5 * first.surface.vertices)
    assert [note for note in first.notes if "53.0 cm" in note]
    assert [note for note in after.notes if note.startswith("datum chosen")] == [
        first.notes[0].replace("53.0 cm", "79.4 cm")
    ]


@pytest.mark.parametrize("as_surface", [False, True], ids=["vertices", "surface"])
def test_what_a_file_has_several_times_at_one_place_moves_together(as_surface: bool):
    """As an STL has it, a vertex per corner of a face: the OBJ that is written lists them all."""
    shape = make_shape("dome", resolution=9, triangles=True)
    corners = shape.faces[:, :3]
    read = make_surface(
        shape.vertices[corners].reshape(-1, 3), np.arange(corners.size).reshape(-1, 3), split_corners=True
    )
    assert len(read.input_vertices) > len(read.vertices)
    vertices = read.vertices * [1.0, 1.2, 1.0]
    given = replace(read, vertices=vertices) if as_surface else vertices
    after = change_surface(flatten(read, device=DEVICE), given)
    np.testing.assert_allclose(after.surface.input_vertices, read.input_vertices * [1.0, 1.2, 1.0], atol=1e-12)


@pytest.mark.parametrize("fabric", [3, None, ["denim"]])
def test_what_is_no_fabric_is_told(dome: Flattening, fabric: Any):
    with pytest.raises(InputError, match="is neither a Fabric nor the name of one"):
        change_fabric(dome, fabric)
    with pytest.raises(InputError, match="is neither a Fabric nor the name of one"):
        flatten(dome.surface, fabric=fabric)


def test_another_mesh_is_refused():
    first = flatten(make_shape("dome", resolution=9), datum="centre", device=DEVICE)
    for other in (make_shape("dome", resolution=11), make_shape("dome", resolution=9, triangles=True)):
        with pytest.raises(InputError, match=r"another mesh .* flatten it afresh"):
            change_surface(first, other)
