"""What a mesh's numbers, windings and directions must not change: the model energy."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import bodice, make_shape

IntArray = NDArray[np.int32]
WIDTH = 21
WHOLE = bodice(resolution=WIDTH)
# The energy at which a relaxation stops may differ by this share.
TOLERANCE = 1e-3


def split(faces: IntArray, first: int) -> IntArray:
    """The two triangles of each quad on both sides of its diagonal from corner `first`, 0 or 1."""
    a, b, c, d = np.roll(faces, -first, axis=1).T
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def flattened(
    vertices: NDArray[np.float64], faces: IntArray, datum: IntArray, fabric: str, relax: RelaxOptions | None = None
) -> Flattening:
    surface = make_surface(vertices, faces, lines={"datum": datum})
    return flatten(surface, datum="datum", fabric=fabric, relax=relax)


def energy(result: Flattening) -> float:
    return result.stages[-1].model_energy_j


def is_as_good(ours: Flattening, theirs: Flattening) -> bool:
    """Whether one converged without a flip at the other's energy."""
    return ours.converged and ours.flipped_faces == 0 and energy(ours) == pytest.approx(energy(theirs), rel=TOLERANCE)


@pytest.fixture(scope="module", params=["isotropic quads", "woven quads", "woven triangles", "linen triangles"])
def whole(request: pytest.FixtureRequest) -> Flattening:
    fabric, kind = request.param.split()
    faces = WHOLE.faces if kind == "quads" else split(WHOLE.faces, 0)
    return flattened(WHOLE.vertices, faces, WHOLE.lines["centre"], fabric)


@hypothesis.settings(max_examples=6, deadline=None)
@hypothesis.given(
    order=st.sampled_from(["kept", "rows and columns exchanged", "permuted"]),
    faces_sorted=st.booleans(),
    reversed_winding=st.booleans(),
    first_corner=st.sampled_from([0, 1, 2, 3, None]),
    mirrored=st.booleans(),
    turn=st.sampled_from([0.0, 0.4]),
    seed=st.integers(0, 9),
)
def test_a_grid_is_as_good_however_it_is_numbered_and_wound(
    whole: Flattening,
    order: str,
    faces_sorted: bool,
    reversed_winding: bool,
    first_corner: int | None,
    mirrored: bool,
    turn: float,
    seed: int,
) -> None:
    rng, count = np.random.default_rng(seed), len(WHOLE.vertices)
    number = np.arange(count)
    if order == "rows and columns exchanged":
        number = np.arange(count).reshape(WIDTH, -1).T.ravel()
    if order == "permuted":
        number = rng.permutation(count)
    vertices = np.empty_like(WHOLE.vertices)
    vertices[number] = WHOLE.vertices
    faces = number[WHOLE.faces if whole.surface.is_quad.all() else split(WHOLE.faces, seed % 2)]
    sides = faces.shape[1]
    faces = faces[np.argsort(faces.min(axis=1))] if faces_sorted else faces[rng.permutation(len(faces))]
    turns = rng.integers(4, size=len(faces)) if first_corner is None else np.full(len(faces), first_corner)
    faces = np.take_along_axis(faces, (turns[:, None] + np.arange(sides)) % sides, axis=1)
    if reversed_winding:
        faces = faces[:, ::-1]
    c, s = np.cos(turn), np.sin(turn)
    vertices = vertices * [-1.0 if mirrored else 1.0, 1.0, 1.0] @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert is_as_good(flattened(vertices, faces, number[WHOLE.lines["centre"]], whole.fabric.name), whole)


@pytest.mark.parametrize("fabric", ["isotropic", "denim"])
@pytest.mark.parametrize("reversed_winding", [False, True])
def test_both_diagonals_of_a_split_grid_are_as_good(reversed_winding: bool, fabric: str) -> None:
    """The bodice is its own mirror image, so that the two differ in their numbers only."""
    centre = WHOLE.lines["centre"]
    first, second = (
        flattened(WHOLE.vertices, faces[:, ::-1] if reversed_winding and k else faces, centre, fabric)
        for k, faces in enumerate((split(WHOLE.faces, 0), split(WHOLE.faces, 1)))
    )
    assert is_as_good(first, second)


@pytest.mark.parametrize("fabric", ["woven", "linen"])
def test_soft_cloth_ends_where_stricter_tolerances_end(fabric: str) -> None:
    shape = make_shape("dome", resolution=15)
    border = border_of(shape)
    strict = RelaxOptions(energy_left=0.0, energy_tolerance=1e-9, residual_tolerance=1e-4)
    ends = [
        flattened(shape.vertices * [0.6, 1.0, 1.0], split(shape.faces, 0), shape.lines["centre"], fabric, relax)
        for relax in (None, strict)
    ]
    way = np.diff([end.positions[border] - end.positions[border].mean(axis=0) for end in ends], axis=0)[0]
    assert np.linalg.norm(way, axis=1).max() <= 2e-4
    assert energy(ends[0]) == pytest.approx(energy(ends[1]), rel=TOLERANCE)


@pytest.mark.parametrize(("kind", "model"), [("quads", "springs"), ("quads", "membrane"), ("triangles", "membrane")])
def test_an_isotropic_sheet_does_not_feel_its_grain(kind: str, model: str) -> None:
    faces = WHOLE.faces if kind == "quads" else split(WHOLE.faces, 0)
    surface: Surface = make_surface(WHOLE.vertices, faces, lines={"datum": WHOLE.lines["centre"]})
    results = [
        flatten(surface, datum="datum", fabric="isotropic", grain_angle=angle, model=model)  # type: ignore[arg-type]
        for angle in (0.0, 30.0, 45.0)
    ]
    border = border_of(surface)
    outlines = [result.positions[border] - result.positions[border].mean(axis=0) for result in results]
    for result, outline in zip(results[1:], outlines[1:], strict=True):
        for name in ("model_energy_j", "strain_energy_j"):
            energy, wished = getattr(result.stages[-1], name), getattr(results[0].stages[-1], name)
            assert energy == pytest.approx(wished, rel=1e-6), name
        assert np.abs(outline - outlines[0]).max() < 1e-6
