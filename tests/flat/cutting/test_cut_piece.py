from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from real_files import DATA, needs_data

import warpflat
from warpflat.app.scene.auto_cut import AutoCutTable, cut_automatically
from warpflat.app.scene.cuts import plan_cuts
from warpflat.app.scene.schema import CutTable
from warpflat.core.errors import InputError
from warpflat.flat.cutting.candidates import find_candidates, find_peaks
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan, line_part
from warpflat.flat.cutting.dart_move import move_dart
from warpflat.flat.cutting.ledger import LEAST_MOUTH, LedgerEntry, make_ledger
from warpflat.flat.cutting.refine_piece import refine_along
from warpflat.flat.cutting.separate_pieces import separate
from warpflat.flat.flattening.fit_report import garment_wear
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface import half_edges as mesh_half_edges
from warpflat.flat.surface.cells import face_creases, make_cells
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.pieces import apply_cut
from warpflat.flat.surface.cut.split_faces import split_faces_along
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.lines import line_on_plane, with_lines
from warpflat.flat.surface.paths.trace import geodesic_path
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.pattern.export.piece_files import save_piece

N = 33
FINE = RelaxOptions(residual_tolerance=1e-6, energy_tolerance=1e-12, max_steps=60_000)


def stored(result: Flattening) -> float:
    """What the relaxation minimises [J]."""
    return result.stages[-1].model_energy_j


def worn(result: Flattening) -> float:
    return result.stages[-1].strain_energy_j


def grid(n: int = N) -> NDArray[np.int32]:
    return np.arange(n * n, dtype=np.int32).reshape(n, n)


def paper_cuts() -> tuple[CutPlan, CutPlan]:
    """A: the bust line from either side to the bust points. B: the princess lines from the hem to the bust points."""
    right = round((0.5 - 0.55 / np.pi) * (N - 1))
    left, level = N - 1 - right, round(0.28 / 0.45 * (N - 1))
    bust = CutPlan(name="bust", paths=(grid()[level, : right + 1], grid()[level, left:][::-1]))
    return bust, CutPlan(name="princess", paths=(grid()[: level + 1, right], grid()[: level + 1, left]))


@pytest.fixture(scope="module")
def bodice() -> Flattening:
    return warpflat.flatten(make_shape("bodice", resolution=N), fabric="woven", datum="centre")


@pytest.fixture(scope="module")
def bust_cut(bodice: Flattening) -> Flattening:
    return cut(bodice, paper_cuts()[0])


def fan(radius_at: Callable[[float], float], height_at: Callable[[float], float], sectors: int, rings: int) -> Surface:
    """A surface of revolution with a pole (vertex 0) of triangles, then rings of quads; ring k starts at 1 + k sectors."""
    points = [[0.0, height_at(0.0), 0.0]]
    for ring in range(1, rings + 1):
        t = ring / rings
        points += [
            [radius_at(t) * math.sin(a), height_at(t), radius_at(t) * math.cos(a)]
            for a in 2 * np.pi * np.arange(sectors) / sectors
        ]
    ring_of = 1 + np.arange(rings * sectors).reshape(rings, sectors)
    after = np.roll(ring_of, -1, axis=1)
    caps = [[0, int(a), int(b), -1] for a, b in zip(ring_of[0], after[0], strict=True)]
    quads = [
        [int(ring_of[k, j]), int(ring_of[k + 1, j]), int(after[k + 1, j]), int(after[k, j])]
        for k in range(rings - 1)
        for j in range(sectors)
    ]
    return make_surface(np.array(points), np.array(caps + quads, dtype=np.int32), name="fan")


def meridian(surface: Surface, sectors: int, rings: int, number: int, *, last: int = 0) -> NDArray[np.int32]:
    """From the border along a meridian, to ring `last` (0: the pole)."""
    row = [1 + (ring - 1) * sectors + number if ring else 0 for ring in range(rings, last - 1, -1)]
    return np.array(row, dtype=np.int32)


# --- the paper's case


def test_both_cuts_release_at_least_what_the_paper_reports_and_the_princess_line_more(
    bodice: Flattening, bust_cut: Flattening
):
    princess_cut = cut(bodice, paper_cuts()[1])
    for energy in (stored, worn):
        a, b = energy(bust_cut) / energy(bodice) - 1, energy(princess_cut) / energy(bodice) - 1
        assert a <= -0.205
        assert b <= -0.301
        assert b < a
    for result in (bust_cut, princess_cut):
        assert result.converged
        assert result.flipped_faces == 0
        assert all(seam["opening_m"] > 0.05 for made in result.measures["cuts"] for seam in made["seams"])


@needs_data
def test_the_paper_cuts_on_a_real_body():
    surface = read_surface(DATA / "front_bodice_raw.obj", units="m")
    surface = with_lines(surface, {"centre front": line_on_plane(surface, [0, 0, 0], [1, 0, 0])})
    v = surface.vertices
    chest = (v[:, 1] > 1.10) & (v[:, 1] < 1.20)
    tables = []
    for side in (-1.0, 1.0):
        bust_point = v[np.argmax(np.where(chest & (side * v[:, 0] > 0.03), v[:, 2], -1.0))].tolist()
        across = {"point": bust_point, "normal": [0.0, 1.0, 0.0], "towards": [side, 0.0, 0.0]}
        down = {"point": bust_point, "normal": [1.0, 0.0, 0.0], "towards": [0.0, -1.0, 0.0]}
        tables += [{"name": "A", "plane": across}, {"name": "B", "plane": down}]
    sequence = plan_cuts(surface, [CutTable.model_validate(table) for table in tables])
    uncut = warpflat.flatten(sequence.surface, fabric="woven", datum="centre front")
    bust_cut, princess_cut = (cut(uncut, plan) for plan in sequence.plans)
    assert uncut.converged
    for energy in (stored, worn):
        a, b = energy(bust_cut) / energy(uncut) - 1, energy(princess_cut) / energy(uncut) - 1
        assert a <= -0.205
        assert b <= -0.301
        assert b < a
    for result in (bust_cut, princess_cut):
        assert result.converged
        assert result.flipped_faces == 0


# --- developable surfaces, a sphere


def test_a_cone_cut_along_a_generator_lies_flat_with_the_known_crack():
    sectors, rings, radius, height = 16, 6, 0.2, 0.15
    surface = fan(lambda t: radius * t, lambda t: -height * t, sectors, rings)
    uncut = warpflat.flatten(surface, fabric="isotropic", datum=meridian(surface, sectors, rings, 0))
    result = cut(uncut, CutPlan(name="generator", paths=(meridian(surface, sectors, rings, 8),)), relax=FINE)
    assert stored(uncut) > 1e-3
    assert stored(result) <= 1e-9 * stored(uncut)
    side, chord = math.hypot(radius, height), 2 * radius * math.sin(math.pi / sectors)
    deficit = 2 * math.pi - sectors * 2 * math.asin(chord / 2 / side)
    (seam,) = result.measures["cuts"][0]["seams"]
    assert seam["kind"] == "dart"
    assert math.radians(seam["angle_deg"]) == pytest.approx(deficit, rel=1e-4)
    assert seam["opening_m"] == pytest.approx(2 * side * math.sin(deficit / 2), rel=1e-4)


def test_a_tube_is_refused_uncut_and_lies_flat_once_cut_along_its_height():
    sectors, rows, radius, height = 16, 6, 0.15, 0.3
    turn = 2 * np.pi * np.arange(sectors) / sectors
    points = [[radius * np.sin(a), height * k / rows, radius * np.cos(a)] for k in range(rows + 1) for a in turn]
    at = np.arange((rows + 1) * sectors, dtype=np.int32).reshape(rows + 1, sectors)
    after = np.roll(at, -1, axis=1)
    quads = np.stack([at[:-1], after[:-1], after[1:], at[1:]], axis=-1).reshape(-1, 4)
    tube = make_surface(np.array(points), quads, name="tube")
    with pytest.raises(InputError, match=r"closed tube .* cut it open along a line first"):
        warpflat.flatten(tube, fabric="isotropic", datum=at[:, 0])
    # No layout of the closed tube has little energy; for scale: laid out as a ring, its middle row at its own length.
    reach = radius + height * (np.arange(rows + 1) / rows - 0.5)
    ring = np.concatenate([r * np.column_stack([np.sin(turn), np.cos(turn)]) for r in np.abs(reach) + 0.02])
    network = SpringNetwork.build(tube, warpflat.find_fabric("isotropic"), ring)
    closed = Relaxation(network, RelaxOptions(), start=ring).energies().potential
    opened = apply_cut(tube, cut_along(tube.faces, [at[:, 8]], vertex_count=len(tube.vertices)))
    result = warpflat.flatten(opened, fabric="isotropic", datum=at[:, 0], relax=FINE)
    assert stored(result) <= 1e-9 * closed
    girth = sectors * 2 * radius * math.sin(math.pi / sectors)
    assert np.ptp(result.positions, axis=0) == pytest.approx([girth, height], rel=1e-6)


def test_a_hemisphere_stores_less_with_every_further_meridian_cut():
    sectors, rings = 16, 7
    surface = fan(
        lambda t: 0.15 * math.sin(t * math.pi / 2), lambda t: 0.15 * math.cos(t * math.pi / 2), sectors, rings
    )
    datum = meridian(surface, sectors, rings, 0)
    uncut = warpflat.flatten(surface, fabric="isotropic", datum=datum)
    energy = [stored(uncut)]
    for n in (1, 2, 4, 8, 16):
        paths = [meridian(surface, sectors, rings, k * sectors // n, last=1) for k in range(n)]
        result = cut(uncut, CutPlan(name=f"{n} gores", paths=tuple(paths)))
        assert result.flipped_faces == 0
        energy.append(stored(result))
    assert all(after < 0.97 * before for before, after in pairwise(energy)), energy
    assert energy[-1] < 0.02 * energy[0]


# --- the cut itself


def test_cutting_conserves_area_faces_and_rest_lengths_and_glues_back(bodice: Flattening, bust_cut: Flattening):
    before, after = bodice.network, bust_cut.network
    used = bust_cut.faces >= 0
    glued = np.where(used, bust_cut.vertex_origin[bust_cut.faces], -1)
    assert np.array_equal(glued, bodice.surface.faces)
    assert after.cell_arrays.area.sum() == pytest.approx(before.cell_arrays.area.sum(), rel=1e-12)
    length = {
        (int(min(ends)), int(max(ends))): rest
        for ends, rest in zip(before.spring_arrays.ends, before.spring_arrays.rest_length, strict=True)
    }
    for ends, rest in zip(
        bust_cut.vertex_origin[after.spring_arrays.ends], after.spring_arrays.rest_length, strict=True
    ):
        assert rest == length[int(min(ends)), int(max(ends))]
    assert float(after.mass.numpy().sum()) == pytest.approx(float(before.mass.numpy().sum()), rel=1e-12)


def test_what_a_cut_knows_of_its_faces_is_not_worked_out_again(
    bodice: Flattening, bust_cut: Flattening, monkeypatch: pytest.MonkeyPatch
):
    made: list[NDArray[np.int32]] = []

    def noted(faces: NDArray[np.int32]) -> mesh_half_edges.HalfEdges:
        made.append(faces)
        return half_edges(faces)

    half_edges = mesh_half_edges.half_edges
    monkeypatch.setattr(mesh_half_edges, "half_edges", noted)
    again = cut(bodice, CutPlan(name="again", paths=bust_cut.cuts[0].paths), relax=RelaxOptions(max_steps=1))
    assert np.array_equal(again.faces, bust_cut.faces)
    assert sum(faces is again.faces for faces in made) == 1


def test_a_cut_has_the_creases_and_cells_that_its_own_surface_tells(bodice: Flattening, bust_cut: Flattening):
    surface = bust_cut.network.surface
    afresh = replace(surface)
    assert make_cells(surface).laid is make_cells(bodice.surface).laid
    assert np.array_equal(face_creases(surface), face_creases(afresh))
    for name, values in vars(make_cells(afresh)).items():
        if name != "around":
            assert np.array_equal(getattr(make_cells(surface), name), values), name
    for name, values in vars(make_cells(afresh).around).items():
        assert np.array_equal(getattr(make_cells(surface).around, name), values), name


def test_the_relaxation_goes_on_from_the_present_layout(bodice: Flattening):
    seen: list[Progress] = []
    first: list[NDArray[np.float64]] = []

    def watch(progress: Progress) -> None:
        if not seen:
            first.append(progress.positions())
        seen.append(progress)

    result = cut(bodice, paper_cuts()[0], callback=watch)
    np.testing.assert_allclose(first[0], bodice.positions[result.vertex_origin], atol=1e-12)
    assert seen[0].model_energy_j == pytest.approx(bodice.stages[-1].model_energy_j, rel=1e-9)
    assert {progress.stage for progress in seen} == {"steps", "cut:bust"}
    assert [stage.name for stage in result.stages] == ["develop", "steps", "relax", "steps", "cut:bust"]


def test_cuts_may_meet_and_follow_one_another(bodice: Flattening, bust_cut: Flattening):
    level = int(paper_cuts()[0].paths[0][0]) // N
    # From the tip of the right bust dart up: a dart that turns a corner, made of two cuts.
    tip = int(paper_cuts()[0].paths[0][-1])
    upwards = CutPlan(name="upwards", paths=(grid()[level : level + 6, tip % N],))
    result = cut(bust_cut, upwards)
    assert result.flipped_faces == 0
    assert stored(result) < stored(bust_cut)
    assert len(result.cuts) == 2
    together = cut(bodice, CutPlan(name="both", paths=(*paper_cuts()[0].paths, *upwards.paths)))
    assert stored(together) == pytest.approx(stored(result), rel=2e-2)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ([0, N + 1], "leaves the mesh between vertices 0 and 34"),
        ([5, 5 + N, 5 + 2 * N, 5 + N], "vertex 38 occurs twice"),
        ([0, 1, 2], "runs along the border between vertices 0 and 1"),
        ([5 + 2 * N, 5 + 3 * N], "cutting edge 71-104 separates nothing"),
        ([5, 99999], "vertex 99999 does not exist"),
    ],
)
def test_a_path_that_cannot_be_cut_is_refused_by_its_vertex(bodice: Flattening, path: list[int], message: str):
    with pytest.raises(InputError, match=message):
        cut(bodice, CutPlan(name="wrong", paths=(np.array(path, dtype=np.int32),)))


def test_a_line_that_does_not_exist_or_has_been_cut_is_refused(bodice: Flattening, bust_cut: Flattening):
    with pytest.raises(InputError, match=r"no line 'burst' .* did you mean 'bust'"):
        cut(bodice, "burst")
    with pytest.raises(InputError, match="cut along 'bust' already"):
        cut(bust_cut, paper_cuts()[0])
    with pytest.raises(InputError, match="is cut by two paths"):
        cut(bust_cut, replace(paper_cuts()[0], name="again"))
    with pytest.raises(InputError, match="holds no edge"):
        line_part(bodice.surface, "bust", (0.5, 0.5))


def test_a_cut_from_border_to_border_leaves_two_pieces_with_names(bodice: Flattening, tmp_path: Path):
    whole = cut(bodice, "centre")
    # Held by one chord, one part would turn the other, and both would take 20,000 steps without coming to rest.
    assert whole.converged
    parts = separate(whole)
    assert sorted(part.surface.name for part in parts) == ["bodice.left", "bodice.right"]
    assert sum(len(part.faces) for part in parts) == len(bodice.faces)
    assert sum(stored(part) for part in parts) < stored(bodice)
    assert [part.datum_name for part in parts] == ["centre", "centre"]
    assert save_piece(parts[0], tmp_path, picture=False, frames=False)[0] == f"{parts[0].surface.name}.obj"
    text = (tmp_path / f"{parts[0].surface.name}.obj").read_text()
    assert text.count("\nv ") == len(bodice.surface.input_vertices)
    assert text.count("\nvt ") == len(parts[0].positions)
    # A part can be cut further.
    again = cut(parts[0], CutPlan(name="dart", paths=(parts[0].surface.lines["bust"][:5],)))
    assert again.flipped_faces == 0


def test_a_part_keeps_its_grain_and_the_length_of_its_own_cuts():
    """With a datum that was chosen, of which one part has nothing, in a cloth whose grain matters."""
    shape = make_shape("dome", resolution=9)
    stiff = warpflat.Fabric(
        name="twill", stiffness_warp=28_000.0, stiffness_weft=4_400.0, shear_stiffness=300.0, areal_density=0.25
    )
    flat = warpflat.flatten(shape, fabric=stiff)
    rows, off = np.arange(81).reshape(9, 9), flat.datum
    across = rows[:, 2] if len({v % 9 for v in off}) == 1 else rows[2]
    dart = rows[4, 8:5:-1] if across is rows[2] else rows[8:5:-1, 4]
    whole = cut(flat, CutPlan(name="two", paths=(across, dart)))
    for part in separate(whole):
        (made,) = part.cuts or (None,)
        if made is not None:
            assert made.length == pytest.approx(warpflat.core.polyline_length(part.surface.vertices[made.paths[0]]))
        again = warpflat.change_fabric(part, stiff)
        assert stored(again) == pytest.approx(stored(part), rel=0.01)
        before, after = (layout.positions - layout.positions.mean(axis=0) for layout in (part, again))
        turn = np.angle(np.vdot(before @ [1, 1j], after @ [1, 1j]))
        assert abs(turn) < math.radians(3)


def test_what_is_known_of_each_face_goes_along_with_cuts_and_refinements(bodice: Flattening):
    known = replace(bodice, close=np.arange(len(bodice.faces)) % 3 == 0)
    parts = separate(cut(known, "centre"))
    assert sum(part.close.sum() for part in parts) == known.close.sum()
    assert all(0.0 <= part.fit.held <= 1.0 for part in parts)
    across = geodesic_path(known.surface, N // 3, N * N - 2 * N // 3)
    refined, path = refine_along(known, "across", across)
    assert len(refined.close) == len(refined.faces) > len(known.faces)
    parts = separate(cut(refined, CutPlan(name="across", paths=(path,))))
    assert [len(part.development.positions) for part in parts] == [len(part.surface.vertices) for part in parts]


def test_a_trial_on_several_pieces_counts_their_cloth_as_the_garment_does():
    """By its flat area, of which the worn stretch leaves less; a mouth of just the least width can be sewn."""
    pieces = [
        warpflat.flatten(make_shape("bodice", resolution=13), fabric="woven"),
        warpflat.flatten(make_shape("cylinder", resolution=9), fabric="jersey", wear=warpflat.Wear(stretch_weft=0.15)),
    ]
    entry = LedgerEntry.measure("seam", pieces, pieces, paths=[], cracks=[])
    told = garment_wear({piece.surface.name: piece.measures for piece in pieces})
    assert entry.outside_before == pytest.approx(told["outside"])
    assert entry.outside_before > 0.0
    widths = (LEAST_MOUTH, 0.99 * LEAST_MOUTH)
    assert [replace(entry, opening=width, angle=0.1).can_be_sewn for width in widths] == [True, False]


def test_remedies_go_with_what_they_were_for():
    advised = warpflat.advise(warpflat.flatten(make_shape("bodice", resolution=13), fabric="woven"))
    assert advised.remedies
    assert warpflat.advise(advised).notes == advised.notes
    parted = replace(cut(advised, "centre"), remedies=advised.remedies)
    assert all(part.remedies == () for part in separate(parted))
    looser = warpflat.change_fabric(advised, "jersey")
    assert looser.fit.within_limits
    assert looser.remedies == warpflat.advise(looser).remedies == ()


def test_a_doubled_vertex_is_doubled_in_the_pattern_only(bust_cut: Flattening, tmp_path: Path):
    save_piece(bust_cut, tmp_path, picture=False, frames=False)
    text = (tmp_path / "bodice.obj").read_text()
    assert text.count("\nv ") == N * N
    assert text.count("\nvt ") == len(bust_cut.positions) == N * N + sum(len(p) - 1 for p in paper_cuts()[0].paths)


def test_darts_are_drawn_with_equal_legs_and_their_tip_moved_back(bodice: Flattening):
    result = cut(bodice, replace(paper_cuts()[0], tip_back=0.02))
    for seam in result.measures["cuts"][0]["seams"]:
        mouth_left, tip, mouth_right = (np.array(p) for p in seam["drawn"]["points_m"][:3])
        legs = [np.linalg.norm(mouth_left - tip), np.linalg.norm(mouth_right - tip)]
        assert legs[0] == pytest.approx(legs[1], rel=1e-9)
        assert legs[0] == pytest.approx(np.mean(seam["legs_m"]) - 0.02, abs=2e-3)
        assert seam["intake_m"] == pytest.approx(seam["opening_m"], rel=0.05)


def test_a_dart_moved_to_another_line_keeps_its_budget(bust_cut: Flattening):
    moved = move_dart(bust_cut, "bust", paper_cuts()[1])
    assert [made.name for made in moved.result.cuts] == ["princess"]
    assert moved.result.flipped_faces == 0
    assert moved.result.converged
    assert moved.energy_both < min(moved.energy_before, moved.energy_after)
    before = Relaxation(bust_cut.network, RelaxOptions(), start=bust_cut.positions).energies()
    assert before.guard > 0.1 * before.potential
    assert moved.energy_before == pytest.approx(before.potential, rel=1e-6)
    assert moved.energy_after == moved.result.stages[-1].model_energy_j
    # The bust's angle defect must open somewhere: both darts show most of it.
    assert moved.angle_after == pytest.approx(moved.angle_before, rel=0.4)
    with pytest.raises(InputError, match="no cut 'bosom' to close"):
        move_dart(bust_cut, "bosom", paper_cuts()[1])


# --- paths between points


def test_a_path_between_points_is_straight_on_the_surface_and_not_a_staircase():
    surface = make_shape("cylinder", radius=0.15, height=0.4, angle=180.0, resolution=21, triangles=True)
    start, end = surface.vertices[3], surface.vertices[21 * 13 + 8]
    split = split_faces_along(surface, geodesic_path(surface, start, end))
    drawn = replace(split.surface, lines={**split.surface.lines, "slant": split.path})
    points = drawn.vertices[drawn.lines["slant"]]
    flat = np.column_stack([0.15 * np.arctan2(points[:, 0], points[:, 2]), points[:, 1]])
    chord = flat[-1] - flat[0]
    off = np.abs((flat - flat[0]) @ np.array([-chord[1], chord[0]])) / np.linalg.norm(chord)
    assert off.max() < 0.1 * 0.4 / 20
    result = cut(warpflat.flatten(drawn, fabric="woven", datum="centre"), "slant")
    assert result.flipped_faces == 0
    assert result.measures["cuts"][0]["length_m"] == pytest.approx(np.linalg.norm(chord), rel=5e-3)


def test_refining_a_flat_pattern_leaves_every_point_where_it_lies(bust_cut: Flattening):
    path = geodesic_path(bust_cut.surface, [0.02, 0.01, 0.12], [0.03, 0.20, 0.13])
    refined, row = refine_along(bust_cut, "drawn", path)
    assert refined.flipped_faces == 0
    old = len(bust_cut.surface.vertices)
    assert np.array_equal(refined.positions[:old], bust_cut.positions[:old])
    assert len(refined.cuts[0].seams) == len(bust_cut.cuts[0].seams)
    assert np.array_equal(refined.surface.lines["drawn"], row)


# --- candidates and ledger


def test_the_ledger_ranks_candidates_by_what_they_release(bodice: Flattening):
    peaks = find_peaks(bodice)
    assert len(peaks) >= 2
    x = bodice.surface.vertices[list(peaks[:2]), 0]
    assert x[0] == pytest.approx(-x[1], abs=1e-9)
    ledger = make_ledger(bodice)
    assert "bust" in ledger.peaks[0]
    # Two that mirror each other are told apart by the next line.
    assert len(set(ledger.peaks)) == len(ledger.peaks)
    assert len(repr(ledger)) < 200
    assert max(len(repr(entry)) for entry in ledger.entries) < 800
    per_cm = [entry.per_cm for entry in ledger.entries]
    assert per_cm == sorted(per_cm, reverse=True)
    by_name = {entry.candidate.name: entry for entry in ledger.entries}
    pair = next(entry for name, entry in by_name.items() if name.startswith("bust from") and " and " in name)
    single = by_name["bust from left"]
    assert single.candidate.has_twin
    assert not pair.candidate.has_twin
    assert pair.model_energy_after < single.model_energy_after < single.model_energy_before
    assert pair.length == pytest.approx(2 * single.length, rel=0.05)
    assert math.isnan(by_name["bust, whole"].angle)
    # Coarse is enough to rank: within a few per cent of the full relaxation.
    full = cut(bodice, CutPlan(name="x", paths=pair.candidate.paths))
    assert pair.released == pytest.approx(stored(bodice) - stored(full), rel=0.05)
    widest = max(seam["opening_m"] for seam in full.measures["cuts"][0]["seams"])
    assert pair.opening == pytest.approx(widest, rel=0.05)


def test_cutting_by_itself_stops_when_it_is_enough(bodice: Flattening):
    untouched, none = cut_automatically(bodice, AutoCutTable(stop_below=1.01 * stored(bodice)))
    assert untouched is bodice
    assert none == ()
    result, ledgers = cut_automatically(bodice, AutoCutTable(max_cuts=1, by="per_cm"))
    assert len(result.cuts) == len(ledgers) == 1
    assert len(result.cuts[0].paths) == 2, "of a mirrored pair both are cut"
    assert result.converged
    assert stored(result) < 0.5 * stored(bodice)


def test_triangles_have_free_paths_that_are_drawn_straight():
    surface = make_shape("bodice", resolution=21, triangles=True)
    flat = warpflat.flatten(surface, fabric="woven", datum="centre")
    free = [one for one in find_candidates(flat) if one.drawn]
    assert free
    entry = make_ledger(flat, candidates=free[:1]).entries[0]
    assert entry.released > 0
    assert entry.result.flipped_faces == 0


def cap() -> Flattening:
    """A hemisphere's energy is highest all along its border, nowhere inside."""
    angle = np.radians(80)
    surface = fan(lambda t: 0.1 * math.sin(t * angle), lambda t: 0.1 * math.cos(t * angle), 32, 10)
    return warpflat.flatten(surface, fabric="woven", datum=meridian(surface, 32, 10, 0))


def test_from_peaks_at_the_border_cuts_lead_inwards():
    flat = cap()
    ledger = make_ledger(flat, by="released", candidates=[one for one in find_candidates(flat) if not one.has_twin])
    best = ledger.entries[0]
    assert best.candidate.name.startswith("inward ")
    assert len(best.candidate.drawn) == 2
    assert best.released > 0.8 * stored(flat)
    assert best.helps
    half_of_it = next(entry for entry in ledger.entries if entry.candidate.name.startswith("short inward"))
    assert half_of_it.length == pytest.approx(0.5 * best.length, rel=0.1)
    # The tips are four fifths of the way to the pole.
    for path in best.candidate.drawn:
        assert np.hypot(*path.points[-1, [0, 2]]) < 0.04
        assert np.hypot(*path.points[0, [0, 2]]) > 0.098


def test_no_way_inwards_begins_beside_an_earlier_cut():
    """There would be strips of cloth between them."""
    flat = cap()
    (first,) = (one for one in find_candidates(flat) if one.name == "inward 1")
    cut_once = make_ledger(flat, candidates=[first]).entries[0].result
    ways = [one for one in find_candidates(cut_once) if "inward" in one.name]
    assert ways
    mouths = np.array([path.points[0] for one in ways for path in one.drawn])
    assert np.linalg.norm(mouths - first.drawn[0].points[0], axis=1).min() > 0.03
    result, _ = cut_automatically(flat, AutoCutTable(max_cuts=3))
    names = [made.name for made in result.cuts]
    assert len(set(names)) == len(names) > 0


def test_a_cut_that_overlaps_is_told_and_not_made_by_itself():
    """The border of a saddle is too long for its middle: cloth is missing along a cut from there."""
    flat = warpflat.flatten(make_shape("saddle", resolution=17), fabric="interlock", datum="centre")
    ledger = make_ledger(flat)
    assert ledger.entries[0].released > 0
    assert all(not entry.helps and entry.angle < 0 for entry in ledger.entries)
    assert cut_automatically(flat, AutoCutTable())[0] is flat


def test_a_piece_that_lies_flat_but_for_rounding_has_nothing_to_cut_for():
    flat = warpflat.flatten(make_shape("cylinder", resolution=9), fabric="woven", datum="centre")
    with pytest.raises(InputError, match="stores no strain energy inside: there is nothing to cut for"):
        find_candidates(flat)


def test_a_piece_without_energy_has_nothing_to_cut_for():
    flat = warpflat.flatten(make_shape("cylinder", resolution=9), fabric="woven", datum="centre")
    result, ledgers = cut_automatically(flat, AutoCutTable(stop_below=1e-6))
    assert result is flat
    assert ledgers == ()


def test_no_candidates_are_told_where_there_is_no_peak_either():
    """Of a row of faces all vertices lie on the border."""
    x, y = np.meshgrid(np.linspace(0.0, 0.2, 5), [0.0, 0.05])
    row = np.array([[k, k + 1, k + 6, k + 5] for k in range(4)])
    flat = warpflat.flatten(make_surface(np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3), row, name="row"))
    with pytest.raises(InputError, match="has no line to cut along"):
        make_ledger(flat, candidates=())
    with pytest.raises(InputError, match="by = 'per_m' is unknown; did you mean 'per_cm'\\? valid: per_cm, released"):
        make_ledger(flat, by="per_m", candidates=())  # type: ignore[arg-type]
