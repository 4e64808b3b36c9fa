"""Many pieces at once: each with the pattern, the energy and the history that it would have alone."""

from __future__ import annotations

import numpy as np
import pytest
from devices import DEVICE
from scipy.spatial import cKDTree
from surface_meshes import quads_between

import warpflat
from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.flatten_all import flatten_all
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver.metric import stiffness_matrix
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.mesh import Surface, join_surfaces
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.join_networks import join_networks

CLOTH = Fabric(
    name="cloth",
    stiffness_warp=1000.0,
    stiffness_weft=600.0,
    shear_stiffness=150.0,
    areal_density=0.15,
    poisson_ratio=0.2,
)


def shape(name: str, resolution: int, *, size: float = 1.0, triangles: bool = False) -> Surface:
    made = make_shape(name, resolution=resolution, triangles=triangles)
    return make_surface(size * made.vertices, made.faces, lines=made.lines, name=f"{name} {size:.3g}")


def potential(piece: Flattening) -> float:
    return piece.stages[-1].model_energy_j


def outline_difference(one: Flattening, other: Flattening) -> float:
    """Largest distance of the outlines [m], each about its centre: nothing says where on the cloth a piece lies."""
    loops = [np.concatenate(border_loops(piece.faces)) for piece in (one, other)]
    lines = [
        piece.positions[loop] - piece.positions[loop].mean(0) for piece, loop in zip((one, other), loops, strict=True)
    ]
    return float(cKDTree(lines[0]).query(lines[1])[0].max())


TOGETHER = {
    "sizes of a grid of quads": ([shape("dome", 21, size=size) for size in (0.9, 1.0, 1.15)], {}),
    # Onsets of their own, and some that need many more iterations than others.
    "unlike sizes and meshes": (
        [
            shape("bodice", 33), shape("dome", 9), shape("saddle", 17), shape("bodice", 33, triangles=True),
            shape("dome", 21, size=0.5, triangles=True),
        ],
        {"fabric": find_fabric("interlock")},
    ),
    "soft cloth on quads and triangles": (
        [shape("dome", 17, triangles=True), shape("bodice", 15, triangles=True), shape("bodice", 17)],
        {"fabric": "woven"},
    ),
    "the paper's steps": (
        [shape("dome", 15), shape("bodice", 15), shape("dome", 15, size=1.2)], {"relax": RelaxOptions(solver="paper")},
    ),
    "the membrane worn stretched": (
        [shape("dome", 13, triangles=True), shape("bodice", 13)],
        {"fabric": "jersey", "model": "membrane", "wear": Wear(stretch_warp=0.05, stretch_weft=0.1)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", TOGETHER)
def test_pieces_flattened_at_once_are_what_each_is_alone(case: str):
    surfaces, options = TOGETHER[case]
    given = {"fabric": CLOTH, "datum": "centre", "device": DEVICE, **options}
    batch = flatten_all(surfaces, **given)
    assert len(batch) == len(surfaces)
    for surface, piece in zip(surfaces, batch, strict=True):
        alone = flatten(surface, **given)
        assert piece.surface is surface
        assert piece.network.surface is surface
        assert piece.converged
        assert piece.flipped_faces == 0
        assert potential(piece) == pytest.approx(potential(alone), rel=1e-3)
        assert outline_difference(piece, alone) < 1e-4
        steps = [] if piece.options.solver == "paper" else ["steps"]
        assert [stage.name for stage in piece.stages] == ["develop", *steps, "relax"]
        assert piece.stages[0].model_energy_j == pytest.approx(alone.stages[0].model_energy_j, rel=1e-12)
        assert piece.stages[0].strain_energy_j == pytest.approx(alone.stages[0].strain_energy_j, rel=1e-12)
        last = piece.stages[-1]
        assert last.strain_energy_j == pytest.approx(piece.worn.energy.sum(), rel=1e-12)
        limits = RelaxOptions()
        if last.left is None:
            assert last.residual <= limits.residual_tolerance
        else:
            assert last.left.energy_share <= limits.energy_left
            assert last.left.outline_mm <= limits.outline_left_mm
        np.testing.assert_allclose(piece.history[-1, 1:3], [last.model_energy_j, last.guard_energy_j])
        assert piece.history[-1, 0] == sum(stage.steps for stage in piece.stages)
        assert piece.notes == alone.notes
        assert piece.measures["length_error"] == pytest.approx(alone.measures["length_error"], rel=1e-2)
    if case == "the paper's steps":  # each stops for itself
        assert batch[0].stages[-1].steps != batch[1].stages[-1].steps


def test_repeated_pieces_are_as_alone():
    """Nothing of one piece gets to another: of the same three each is what one alone is."""
    alone = flatten(shape("dome", 21), fabric=CLOTH, datum="centre", device=DEVICE)
    for piece in flatten_all([shape("dome", 21) for _ in range(3)], fabric=CLOTH, datum="centre", device=DEVICE):
        np.testing.assert_allclose(piece.positions, alone.positions, atol=1e-12)


def test_a_piece_of_a_batch_can_be_cut():
    surfaces = [shape("dome", 21), shape("bodice", 17)]
    piece = flatten_all(surfaces, fabric=CLOTH, datum="centre", device=DEVICE)[0]
    alone = flatten(surfaces[0], fabric=CLOTH, datum="centre", device=DEVICE)
    path = np.arange(21 * 21, dtype=np.int32).reshape(21, 21)[:12, 6]
    plan = CutPlan(name="dart", paths=(path,))
    assert potential(cut(piece, plan)) == pytest.approx(potential(cut(alone, plan)), rel=1e-3)


def test_datums_of_their_own_and_a_chosen_one():
    surfaces = [shape("dome", 13), shape("bodice", 13)]
    line = surfaces[1].lines["centre"]
    given, chosen = flatten_all(surfaces[::-1], fabric=CLOTH, datum=[line, None], device=DEVICE)
    np.testing.assert_array_equal(given.datum, line)
    assert chosen.notes[0].startswith("datum chosen")


def test_what_is_told_on_the_way():
    surfaces = [shape("dome", 13), shape("bodice", 21)]
    told: dict[int, list[Progress]] = {0: [], 1: []}
    layouts: dict[int, list[np.ndarray]] = {0: [], 1: []}

    def hear(number: int, progress: Progress) -> None:
        told[number].append(progress)
        layouts[number].append(progress.positions())
        assert progress.face_energy_density().shape == (len(surfaces[number].faces),)

    batch = flatten_all(surfaces, fabric=CLOTH, datum="centre", device=DEVICE, callback=hear)
    for number, piece in enumerate(batch):
        assert told[number][0].stage == "develop"
        assert told[number][0].step == 0
        assert {progress.stage for progress in told[number][1:]} == {"steps", "relax"}
        assert told[number][0].surface is surfaces[number]
        np.testing.assert_array_equal(layouts[number][0], piece.development.positions)
        assert layouts[number][-1].shape == piece.positions.shape
        assert told[number][0].model_energy_j == piece.stages[0].model_energy_j
        assert told[number][-1].step == sum(stage.steps for stage in piece.stages)


def test_a_work_limit_is_told_of_those_that_met_it():
    surfaces = [shape("bodice", 33), make_surface(*flat_sheet(), lines={"centre": np.arange(4, 49, 9)})]
    batch = flatten_all(surfaces, fabric=CLOTH, datum="centre", device=DEVICE, relax=RelaxOptions(max_steps=20))
    assert [piece.converged for piece in batch] == [False, True]


def flat_sheet() -> tuple[np.ndarray, np.ndarray]:
    across, up = np.meshgrid(np.linspace(0, 0.2, 9), np.linspace(0, 0.1, 5))
    faces = quads_between((5, 9))
    return np.column_stack([across.ravel(), up.ravel(), np.zeros(45)]), faces


def test_nothing_is_nothing():
    assert flatten_all([]) == []


def test_what_is_wrong_with_a_piece_is_told_with_its_name():
    surfaces = [shape("dome", 9), shape("bodice", 9)]
    with pytest.raises(InputError, match=r"piece 'bodice 1' has no line 'center' for its datum; did you mean 'centre'"):
        flatten_all(surfaces, datum=["centre", "center"], device=DEVICE)
    with pytest.raises(InputError, match=r"^vertex 5000 does not exist in 'bodice 1'"):
        flatten_all(surfaces, datum=["centre", [0, 5000]], device=DEVICE)
    with pytest.raises(
        InputError, match=r"^piece 'bodice 1' \(surface 1\): a line needs at least two different vertices"
    ):
        flatten_all(surfaces, datum=["centre", [3, 3]], device=DEVICE)
    with pytest.raises(InputError, match=r"datum has 1 entries for 2 surfaces"):
        flatten_all(surfaces, datum=["centre"], device=DEVICE)
    with pytest.raises(InputError, match=r"^unknown fabric 'wooven'"):
        flatten_all(surfaces, fabric="wooven", datum="centre", device=DEVICE)
    with pytest.raises(InputError, match=r"^relax: max_steps = 0"):
        flatten_all(surfaces, relax=RelaxOptions(max_steps=0), datum="centre", device=DEVICE)


def test_it_is_offered_beside_flatten():
    assert warpflat.flatten_all is flatten_all
    assert "flatten_all" in dir(warpflat)


# --- joined networks


def networks(*, quads: bool = False, **options: object) -> list[SpringNetwork]:
    surfaces = [shape("dome", 9, triangles=not quads), shape("bodice", 7), shape("saddle", 8, triangles=not quads)]
    return [
        SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2], device=DEVICE, **options) for surface in surfaces
    ]


def test_a_joined_network_is_listed_as_that_of_the_joined_surface():
    parts = networks()
    joined = join_networks(parts)
    surface = join_surfaces([part.surface for part in parts])
    np.testing.assert_array_equal(joined.surface.faces, surface.faces)
    whole, cells = SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2], device=DEVICE), make_cells(surface)
    springs = whole.spring_arrays
    np.testing.assert_array_equal(joined.springs.offset.numpy(), springs.around.offset)
    np.testing.assert_array_equal(joined.springs.neighbor.numpy(), springs.around.neighbor)
    np.testing.assert_array_equal(joined.springs.rest_length.numpy(), springs.listed_length)
    assert joined.spring_arrays.edge_count == springs.edge_count
    for ends in (joined.spring_arrays.ends, springs.ends):
        assert len(np.unique(np.sort(ends, axis=1), axis=0)) == joined.spring_count
    np.testing.assert_array_equal(joined.mass.numpy(), CLOTH.areal_density * cells.vertex_areas)
    # Cells come in another order, quads first: by their corners.
    order, wished = (np.lexsort(np.sort(corner, axis=1).T) for corner in (joined.cell_arrays.corner, cells.corner))
    np.testing.assert_array_equal(joined.cell_arrays.face[order], cells.face[wished])
    np.testing.assert_array_equal(joined.cell_arrays.area[order], cells.area[wished])
    around = joined.cell_arrays.around
    vertex = np.repeat(np.arange(joined.vertex_count), np.diff(around.offset))
    np.testing.assert_array_equal(joined.cell_arrays.faces.ravel()[around.entry], vertex)


def test_a_joined_network_holds_those_quads_that_its_parts_hold():
    """Long ones lack shear and are held against waves; squares are not."""
    squares, long = (
        SpringNetwork.build(surface, CLOTH, surface.vertices[:, :2], device=DEVICE, model="springs")
        for surface in (shape("dome", 9), shape("strip", 5))
    )
    joined, alone = join_networks([squares, long]).spring_arrays, join_networks([squares, squares]).spring_arrays
    for name in ("hourglass", "shear_deficit"):
        assert getattr(alone, name) is None
        held, of_long = getattr(joined, name), getattr(long.spring_arrays, name)
        np.testing.assert_array_equal(held[squares.face_count :], of_long)
        assert not held[: squares.face_count].any()


@pytest.mark.parametrize("stretched", [False, True])
@pytest.mark.parametrize("models", ["springs", "membrane", "both"])
def test_a_joined_network_has_the_energies_and_forces_of_its_parts(models: str, stretched: bool):
    """Quads along the grain are springs, triangles are cells, also beside each other."""
    parts = networks(quads=models == "springs", model="membrane" if models == "membrane" else None)
    assert [part.model for part in parts[:2]] == [models, models] if models != "both" else ["membrane", "springs"]
    if stretched:
        parts = [
            SpringNetwork.build(
                part.surface,
                CLOTH,
                part.surface.vertices[:, :2],
                device=DEVICE,
                model=part.model,
                stretch=np.full((len(part.surface.faces), 2), 1.02 + 0.01 * number),
            )
            for number, part in enumerate(parts)
        ]
    # Flat cells are worn by a third longer: at a quarter, of 0.8, the guard's stiffness begins to count, and rounding would decide.
    starts = [0.75 * part.surface.vertices[:, :2] for part in parts]
    joined = Relaxation(join_networks(parts), RelaxOptions(), start=np.concatenate(starts))
    alone = [Relaxation(part, RelaxOptions(), start=start) for part, start in zip(parts, starts, strict=True)]
    forces = joined.forces()
    first = np.cumsum([0, *(len(start) for start in starts)])
    for begin, end, state in zip(first[:-1], first[1:], alone, strict=True):
        np.testing.assert_array_equal(forces[begin:end], state.forces())
    each = [state.energies() for state in alone]
    assert joined.energies().spring == pytest.approx(sum(of.spring for of in each), rel=1e-12)
    assert joined.energies().guard == pytest.approx(sum(of.guard for of in each), rel=1e-12)
    assert [state.energies().guard > 0.0 for state in alone] == [part.model == "springs" for part in parts]
    stiffness = stiffness_matrix(joined.network, np.concatenate(starts)).toarray()
    for begin, end, part, start in zip(2 * first[:-1], 2 * first[1:], parts, starts, strict=True):
        np.testing.assert_allclose(stiffness[begin:end, begin:end], stiffness_matrix(part, start).toarray(), atol=1e-9)
        assert not stiffness[begin:end, end:].any()
