"""Multilevel relaxation: the plain method's minimum, without a mirrored face, with less work."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE
from scipy.spatial import Delaunay

from warpflat import flatten_all
from warpflat.cutting.cut_piece import cut
from warpflat.cutting.cut_plan import CutPlan
from warpflat.fabric.fabric import Fabric
from warpflat.flattening.develop import develop
from warpflat.flattening.flatten_piece import flatten
from warpflat.flattening.result import Flattening
from warpflat.model import network
from warpflat.model.network import SpringNetwork
from warpflat.model.springs import springs_of
from warpflat.solver.convergence import Outcome
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.multigrid.levels import Levels
from warpflat.solver.multigrid.solve import relax_multilevel
from warpflat.solver.options import RelaxOptions
from warpflat.solver.relax import relax
from warpflat.solver.relaxation import Relaxation
from warpflat.surface import laplacian, mesh
from warpflat.surface.cut.cut_mesh import cut_along
from warpflat.surface.injective import is_injective
from warpflat.surface.mesh import Surface
from warpflat.surface.repair.validate import make_surface
from warpflat.surface.shapes import make_shape

PLAIN, LEVELS = RelaxOptions(solver="plain"), RelaxOptions(solver="multilevel")


@pytest.fixture(autouse=True)
def cycles_on_small_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    """Grids are cycled here however small they are; `flatten` relaxes small ones by L-BFGS."""
    monkeypatch.setattr(laplacian, "_MOST_OF_QUADS", 0)


def cloth(shear: float) -> Fabric:
    return Fabric(name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=shear, areal_density=0.15)


def cracked(resolution: int, *, triangles: bool = False, column: int = 8) -> Surface:
    whole = make_shape("dome", resolution=resolution, triangles=triangles)
    column = np.arange(resolution**2, dtype=np.int32).reshape(resolution, resolution)[: round(0.6 * resolution), column]
    made = cut_along(whole.faces, column, vertex_count=len(whole.vertices))
    return make_surface(whole.vertices[made.vertex_origin], made.faces, lines={"centre": whole.lines["centre"]})


def irregular(size: int) -> Surface:
    """A dome of about so many vertices, shaken from their rows, with a straight line up its middle."""
    side = round(size**0.5) | 1
    across, up = np.meshgrid(np.linspace(-0.5, 0.5, side), np.linspace(-0.5, 0.5, side))
    shaken = np.random.default_rng(5).uniform(-0.3, 0.3, (2, side, side)) / side
    shaken[:, [0, -1]] = shaken[:, :, [0, -1]] = shaken[:, :, side // 2] = 0.0
    points = np.column_stack([(across + shaken[0]).ravel(), (up + shaken[1]).ravel()])
    triangles = Delaunay(points).simplices
    vertices = np.column_stack([0.5 * points, np.sqrt(0.45**2 - 0.25 * (points**2).sum(axis=1))])
    middle = np.arange(side * side, dtype=np.int32).reshape(side, side)[:, side // 2]
    return make_surface(vertices, triangles, lines={"centre": middle})


def minimum(piece: Flattening) -> float:
    last = piece.stages[-1]
    return last.model_energy_j


def both(surface: Surface, shear: float, **options: object) -> tuple[Flattening, Relaxation, Outcome]:
    """Relaxed plainly; and the same network with levels, from the same development."""
    plain = flatten(
        surface,
        fabric=cloth(shear),
        datum="centre",
        device=DEVICE,
        relax=replace(PLAIN, residual_tolerance=1e-3),
        **options,
    )
    ends = GrainAlignment(lower=int(plain.datum[0]), upper=int(plain.datum[-1]))
    state = Relaxation(plain.network, LEVELS, start=plain.development.positions, alignments=[ends])
    return plain, state, relax_multilevel(state)


@pytest.mark.parametrize("shear", [200.0, 10.0])
@pytest.mark.parametrize(
    ("shape", "resolution", "triangles"),
    [("dome", 33, False), ("bodice", 33, False), ("saddle", 30, False), ("dome", 33, True), ("bodice", 33, True)],
)
def test_the_minimum_is_that_of_the_plain_method(shape: str, resolution: int, triangles: bool, shear: float):
    plain, state, outcome = both(make_shape(shape, resolution=resolution, triangles=triangles), shear)
    assert outcome.converged
    assert not state.mirrored_pieces().any()
    assert outcome.energies.potential == pytest.approx(minimum(plain), rel=1e-3)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_a_crack_opens_as_far_as_with_the_plain_method(triangles: bool):
    plain, state, outcome = both(cracked(25, triangles=triangles), 200.0)
    assert outcome.converged
    assert not state.mirrored_pieces().any()
    assert outcome.energies.potential == pytest.approx(minimum(plain), rel=1e-3)


def test_the_membrane_too():
    plain, state, outcome = both(make_shape("bodice", resolution=33, triangles=True), 200.0, model="membrane")
    assert outcome.converged
    assert not state.mirrored_pieces().any()
    assert outcome.energies.potential == pytest.approx(minimum(plain), rel=1e-3)


@pytest.mark.parametrize("shape", ["dome", "bodice"])
@pytest.mark.parametrize("resolution", [51, 101])
def test_on_a_grid_thirty_units_of_work_come_within_a_thousandth(shape: str, resolution: int):
    surface = make_shape(shape, resolution=resolution)
    done = flatten(surface, fabric=cloth(375.0), datum="centre", device=DEVICE)
    state = Relaxation(done.network, LEVELS, start=done.development.positions)
    seen: list[tuple[float, float]] = []
    relax_multilevel(state, watch=lambda now, energies, _: seen.append((now.work_units, energies.potential)))
    assert min(work for work, energy in seen if energy < 1.001 * minimum(done)) <= 30.0


def uneven(columns: int, rows: int) -> Surface:
    """A dome of quads whose rows and columns are three and five times as far apart beside the middle as in it."""

    def places(count: int) -> np.ndarray:
        first, middle = count // 4, count // 2
        ends = [
            np.linspace(*span, number, endpoint=False) for *span, number in ((-0.5, -0.2, first), (-0.2, 0.0, middle))
        ]
        return np.concatenate([*ends, np.linspace(0.0, 0.5, count - first - middle)])

    x, y = np.meshgrid(places(columns), places(rows))
    i = np.arange(x.size).reshape(x.shape)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    return make_surface(np.stack([x, y, 0.3 * np.cos(2 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3), faces)


@pytest.mark.parametrize("shear", [375.0, 100.0])
def test_uneven_rows_take_sixty_units_too_and_stay_rows(shear: float):
    """Long quads among them: were their shear springs to hold all of the shear, next to nothing would hold one vertex against its four
    neighbours, and every second one would move by half a millimetre, in hundreds of cycles."""
    surface = uneven(100, 120)
    history: list[tuple[float, float]] = []
    done = flatten(
        surface,
        fabric=cloth(shear),
        device=DEVICE,
        callback=lambda p: history.append((p.work_units, p.model_energy)),
    )
    assert done.network.spring_arrays.long_quads > 4_000
    assert next(work for work, energy in history if energy <= 1.001 * minimum(done)) < 60.0
    place = done.positions.reshape(120, 100, 2)
    against = place[1:-1, 1:-1] - 0.25 * (place[:-2, 1:-1] + place[2:, 1:-1] + place[1:-1, :-2] + place[1:-1, 2:])
    chess = (-1.0) ** np.add.outer(np.arange(118), np.arange(98))[..., None]
    # Every second one to one side: what is left of the mean over twelve by twelve.
    moved = (chess * against)[:108, :96].reshape(9, 12, 8, 12, 2).mean(axis=(1, 3))
    assert np.linalg.norm(moved, axis=-1).max() < 1e-5


@pytest.mark.parametrize(("columns", "rows"), [(161, 9), (9, 161), (241, 31)])
def test_long_quads_take_sixty_units_too(columns: int, rows: int):
    """Halved across only until they are nearly square; halved both ways, those 20 times as long as wide took 320 units."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, columns), np.linspace(-0.4, 0.4, rows))
    i = np.arange(x.size).reshape(x.shape)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    surface = make_surface(np.stack([x, y, 0.3 * np.cos(2 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3), faces)
    history: list[tuple[float, float]] = []
    done = flatten(
        surface,
        fabric=cloth(375.0),
        device=DEVICE,
        callback=lambda p: history.append((p.work_units, p.model_energy)),
    )
    assert next(work for work, energy in history if energy <= 1.001 * minimum(done)) < 60.0
    assert done.stages[-1].converged
    assert not done.flipped_faces


@pytest.mark.parametrize("kind", ["crack", "irregular"])
def test_elsewhere_sixty_units_come_within_a_thousandth(kind: str):
    surface = cracked(51, column=17) if kind == "crack" else irregular(2_500)
    done = flatten(surface, fabric=cloth(375.0), datum="centre", device=DEVICE)
    state = Relaxation(done.network, LEVELS, start=done.development.positions)
    seen: list[tuple[float, float]] = []
    relax_multilevel(state, watch=lambda now, energies, _: seen.append((now.work_units, energies.potential)))
    assert min(work for work, energy in seen if energy < 1.001 * minimum(done)) <= 60.0


@pytest.mark.parametrize(("height", "most"), [(0.5, 24.0), (0.8, 48.0)])
def test_a_cut_opens_within_a_few_cycles(height: float, most: float):
    """It opens as a whole, which only the coarsest level finds out soon, and only if it goes to its end."""
    done = flatten(make_shape("dome", resolution=51), fabric=cloth(375.0), datum="centre", device=DEVICE)
    path = np.arange(51**2, dtype=np.int32).reshape(51, 51)[: int(51 * height), 17]
    seen: list[tuple[float, float]] = []
    after = cut(
        done,
        CutPlan(name="dart", paths=(path,)),
        callback=lambda at: seen.append((at.work_units, at.model_energy)),
    )
    assert after.flipped_faces == 0
    assert min(work for work, energy in seen if energy < 1.001 * minimum(after)) <= most


@pytest.mark.parametrize("kind", ["irregular", "split bodice", "crack near a border"])
def test_soft_cloth_and_strips_take_half_of_the_work_that_steps_take_to_a_thousandth(kind: str):
    """The coarse corrections are of use once they have been smoothed, however much they strain the piece before."""
    shear = 375.0 if kind == "crack near a border" else 10.0
    surface = {
        "irregular": lambda: irregular(2_500),
        "split bodice": lambda: make_shape("bodice", resolution=51, triangles=True),
        "crack near a border": lambda: cracked(51, column=5),
    }[kind]()
    done = flatten(surface, fabric=cloth(shear), datum="centre", device=DEVICE)
    start = develop(surface, done.datum).positions
    network = SpringNetwork.build(surface, cloth(shear), start, device=DEVICE)
    works, energies = [], []
    for solve in (relax, relax_multilevel):
        seen: list[tuple[float, float]] = []
        state = Relaxation(network, LEVELS, start=start)
        solve(state, watch=lambda now, energies, _, seen=seen: seen.append((now.work_units, energies.potential)))
        assert not state.mirrored_pieces().any()
        works.append(seen)
        energies.append(seen[-1][1])
    plain, levels = (next(work for work, energy in seen if energy < 1.001 * min(energies)) for seen in works)
    assert levels <= 0.55 * plain


@pytest.mark.parametrize(
    ("triangles", "shear"),
    [(False, 375.0), (True, 375.0), (False, 90.0), (True, 90.0), (False, 20.0), (True, 20.0), (True, 5.0)],
)
def test_a_cycle_never_raises_the_energy_and_mirrors_nothing(triangles: bool, shear: float):
    surface = make_shape("bodice", resolution=33, triangles=triangles)
    piece = flatten(surface, fabric=cloth(shear), datum="centre", device=DEVICE, relax=RelaxOptions(max_steps=1))
    state = Relaxation(piece.network, LEVELS, start=piece.development.positions)
    energies = [state.energies().potential]
    relax_multilevel(state, watch=lambda s, e, r: energies.append(e.potential))
    assert (np.diff(energies) <= 1e-9 * energies[0]).all()
    assert not state.mirrored_pieces().any()


@pytest.mark.parametrize(("shape", "triangles", "most"), [("bodice", False, 57.0), ("dome", True, 90.0)])
def test_from_near_the_minimum_little_work_is_left(shape: str, triangles: bool, most: float):
    """A warmer cloth: the pattern of one fabric is the start of the next."""
    surface = make_shape(shape, resolution=33, triangles=triangles)
    first = flatten(surface, fabric=cloth(200.0), datum="centre", device=DEVICE)
    network = SpringNetwork.build(surface, cloth(180.0), first.positions, device=DEVICE)
    works = []
    for start, nested in ((first.development.positions, True), (first.positions, False)):
        state = Relaxation(network, RelaxOptions(residual_tolerance=2e-2), start=start)
        outcome = relax_multilevel(state, nested=nested)
        assert outcome.converged
        works.append(outcome.work_units)
    assert works[1] < min(most, 0.7 * works[0])


def test_a_cut_goes_on_from_the_layout_that_is_there():
    piece = flatten(make_shape("dome", resolution=33), fabric=cloth(200.0), datum="centre", device=DEVICE)
    path = np.arange(33 * 33, dtype=np.int32).reshape(33, 33)[:17, 10]
    plan = CutPlan(name="dart", paths=(path,))
    released = cut(piece, plan)
    assert released.converged
    assert released.flipped_faces == 0
    assert minimum(released) == pytest.approx(minimum(cut(piece, plan, relax=PLAIN)), rel=1e-3)


def test_a_mesh_without_coarser_levels_is_relaxed_by_steps():
    surface = make_shape("dome", resolution=9)
    piece = flatten(surface, fabric=cloth(200.0), datum="centre", device=DEVICE, relax=RelaxOptions(max_steps=1))
    states = [Relaxation(piece.network, LEVELS, start=piece.development.positions) for _ in range(2)]
    outcomes = relax(states[0]), relax_multilevel(states[1])
    assert outcomes[0].steps == outcomes[1].steps
    np.testing.assert_array_equal(states[0].positions(), states[1].positions())


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_a_repeat_is_equal_bit_for_bit(triangles: bool):
    surface = make_shape("bodice", resolution=33, triangles=triangles)
    first, second = (flatten(surface, fabric=cloth(200.0), datum="centre", device=DEVICE) for _ in range(2))
    np.testing.assert_array_equal(first.positions, second.positions)


def test_a_work_limit_is_reported_not_hidden():
    options = RelaxOptions(solver="multilevel", max_steps=12)
    piece = flatten(make_shape("dome", resolution=33), fabric=cloth(20.0), datum="centre", device=DEVICE, relax=options)
    assert not piece.converged
    assert piece.measures["stages"][-1]["converged"] is False


@pytest.mark.parametrize("kind", ["grid", "crack", "bodice"])
def test_steps_along_lines_bring_soft_cloth_to_the_same_minimum_in_less_work(kind: str, monkeypatch):
    """Where the cloth is K/G = 80 times as stiff along its threads as in shear."""
    surface, datum = make_shape("bodice" if kind == "bodice" else "dome", resolution=41), "centre"
    exact = RelaxOptions(residual_tolerance=1e-4, energy_tolerance=1e-8)
    done = []
    for softest in (network._SOFT, math.inf):
        monkeypatch.setattr(network, "_SOFT", softest)
        piece = flatten(surface, fabric=cloth(1000.0 / 80.0), datum=datum, device=DEVICE, relax=exact)
        if kind == "crack":
            path = np.arange(41 * 41, dtype=np.int32).reshape(41, 41)[:21, 12]
            piece = cut(piece, CutPlan(name="dart", paths=(path,)), relax=exact)
        assert piece.converged
        assert piece.flipped_faces == 0
        done.append((minimum(piece), piece.stages[-1].work_units))
    (here, work), (there, before) = done
    assert here == pytest.approx(there, rel=1e-5)
    assert work < 0.75 * before


@pytest.mark.parametrize("shear", [100.0, 10.0, 2.0])
def test_astep_along_lines_never_raises_the_energy_and_mirrors_nothing(shear: float):
    surface = make_shape("bodice", resolution=33)
    piece = flatten(surface, fabric=cloth(shear), datum="centre", device=DEVICE, relax=RelaxOptions(max_steps=1))
    state = Relaxation(piece.network, LEVELS, start=piece.development.positions)
    made = Levels(state, repair=True)
    rng = np.random.default_rng(5)
    for strained in (1.0, 0.98, 1.03):
        state.position.assign(strained * piece.development.positions + rng.normal(scale=1e-4, size=(33 * 33, 2)))
        for _ in range(12):
            before = state.energies().potential
            (after,) = made.step_along_lines(0)
            assert after <= before
            assert after == pytest.approx(state.energies().potential)
        state.evaluate_at_rest()
        assert not state.mirrored_pieces().any()


def test_pieces_with_and_without_lines_are_relaxed_side_by_side():
    surfaces = [make_shape("dome", resolution=33), make_shape("dome", resolution=33, triangles=True)]
    given = {"fabric": cloth(1000.0 / 60.0), "device": DEVICE, "relax": RelaxOptions(residual_tolerance=1e-3)}
    together = flatten_all(surfaces, datum="centre", **given)
    for piece, surface in zip(together, surfaces, strict=True):
        assert piece.converged
        assert minimum(piece) == pytest.approx(minimum(flatten(surface, datum="centre", **given)), rel=1e-4)


def test_steps_go_along_lines_that_carry_the_threads_only():
    surface = make_shape("dome", resolution=33)
    for grain_angle, expected in ((0.0, True), (10.0, True), (90.0, True), (45.0, False)):
        flat = surface.vertices[:, :2]
        network = SpringNetwork.build(surface, cloth(10.0), flat, grain_angle=grain_angle, device=DEVICE)
        assert (network.line_arrays is not None) == expected
        made = Levels(Relaxation(network, LEVELS, start=flat), repair=True)
        assert [level.has_lines for level in made.all] == [expected] * len(made.sizes)


@pytest.mark.parametrize("kind", ["grid", "crack", "triangles"])
def test_caches_dropped_from_large_pieces_are_made_again_as_they_were(kind: str, monkeypatch: pytest.MonkeyPatch):
    def piece() -> Surface:
        return make_shape("dome", resolution=16) if kind == "grid" else cracked(16, triangles=kind == "triangles")

    monkeypatch.setattr(laplacian, "_MOST_VERTICES", 100)
    kept = flatten(piece(), device=DEVICE)
    monkeypatch.setattr(mesh, "_LARGE", 100)
    surface = piece()
    flat = flatten(surface, device=DEVICE)
    np.testing.assert_array_equal(flat.positions, kept.positions)
    assert any("half_edges_of" in name for name in kept.surface.of_faces)
    assert not any("half_edges_of" in name for name in surface.of_faces)
    springs, theirs = flat.network.spring_arrays, kept.network.spring_arrays
    np.testing.assert_array_equal(springs.around.entry, theirs.around.entry)
    np.testing.assert_array_equal(springs.ends, theirs.ends)
    again = springs_of(surface, flat.fabric, flat.positions)
    np.testing.assert_array_equal(again.stiffness, springs_of(kept.surface, kept.fabric, kept.positions).stiffness)
    assert flat.measures["length_error"] == kept.measures["length_error"]


def test_cycles_on_a_fine_mesh_end_with_a_note_after_a_bounded_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(laplacian, "_MOST_VERTICES", 100)
    monkeypatch.setattr("warpflat.solver.multigrid.solve._PATIENCE", 5.0)
    monkeypatch.setattr("warpflat.solver.multigrid.solve._MOST_WORK", 1.0)
    flat = flatten(cracked(40, triangles=True), fabric="isotropic", device=DEVICE)
    assert not flat.converged
    assert sum("work units of cycles: a coarser mesh, or a cut, may help" in note for note in flat.notes) == 1
    assert is_injective(flat.network.surface, flat.positions)
