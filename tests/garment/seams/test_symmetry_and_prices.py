"""Both sides of a garment are cut alike, one of two mirrored pieces is drawn, and every seam has its price."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import seam_solids as solids
from obj_files import write_obj

import warpflat
from warpflat.app.cli.main import main
from warpflat.app.scene.found_seams import found_seams
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.mirror import mirror_images
from warpflat.garment.seams.anatomy import find_anatomy
from warpflat.garment.seams.find import FoundSeams, cloth_of
from warpflat.garment.seams.symmetric import mirrored


@cache
def lopsided(by: float) -> Surface:
    """A shirt whose left side is wider and has the longer sleeve."""
    plain = solids.shirt(arm=0.4, step=0.045)
    vertices = plain.vertices.copy()
    vertices[:, 0] *= np.where(vertices[:, 0] > 0.0, 1.0 + by, 1.0)
    return warpflat.make_surface(vertices, plain.faces, name="shirt", closed=True)


@cache
def trousers() -> Surface:
    return solids.trousers(step=0.045)


@cache
def found_on(by: float) -> FoundSeams:
    return warpflat.find_seams(lopsided(by))


@pytest.mark.parametrize("by", [0.0, 0.03])
def test_left_and_right_are_cut_alike_within_a_millimetre(by: float) -> None:
    found = found_on(by)
    length = {seam.name: seam.length for seam in found.seams}
    for name in ("armhole", "side", "shoulder", "underarm"):
        assert length[f"{name} left"] == pytest.approx(length[f"{name} right"], abs=1e-4)
    told = [note for note in found.notes if note.startswith("both sides are averaged and cut alike")]
    assert told
    images = mirror_images({piece.name: piece for piece in found.pieces})
    assert {name: mate for name, (mate, _) in images.items()} == {
        "front": "front", "back": "back", "left_sleeve": "right_sleeve", "right_sleeve": "left_sleeve",
    }  # fmt: skip


def test_wrinkles_that_cross_the_middle_to_and_fro_leave_both_sides_alike() -> None:
    plain = solids.skirt(rows=24, around=150)
    x, y, z = plain.vertices.T
    turn, out = np.arctan2(x, z) + 0.4 * np.pi / 75, np.hypot(x, z)
    x, z = out * np.sin(turn), out * np.cos(turn)
    near = 0.02 * np.exp(-((x / 0.05) ** 2)) * (z > 0.0)
    phase = 150.0 * x + 20.0 * y
    wrinkled = np.column_stack([x + near * np.sin(phase), y, z + near * np.cos(phase)])
    found = warpflat.find_seams(warpflat.make_surface(wrinkled, plain.faces, name="skirt"))
    length = {seam.name: seam.length for seam in found.seams}
    assert length["side left"] == pytest.approx(length["side right"], rel=1e-9)
    assert any(note.startswith("both sides are averaged and cut alike") for note in found.notes)


def test_a_seam_on_one_side_alone_keeps_the_sides_apart() -> None:
    cloth = cloth_of(solids.skirt())
    anatomy = find_anatomy(cloth)
    cloth = cloth.with_seam("pocket left", cloth.half_edges.edges[:1].astype(np.int64))
    kept, why = mirrored(cloth, anatomy)
    assert kept is cloth
    assert why == "pocket left is on one side alone"


def test_what_is_not_nearly_symmetric_keeps_its_sides() -> None:
    found = found_on(0.12)
    length = {seam.name: seam.length for seam in found.seams}
    assert length["underarm left"] > 1.05 * length["underarm right"]
    assert not any("averaged and cut alike" in note for note in found.notes)


def test_underarm_and_side_meet_at_the_armhole() -> None:
    pieces = {piece.name: piece for piece in found_on(0.0).pieces}
    for side in ("left", "right"):
        sleeve = pieces[f"{side}_sleeve"]
        underarm = np.concatenate(
            [sleeve.vertices[line[[0, -1]]] for name, line in sleeve.lines.items() if name.startswith("underarm")]
        )
        seams = [line for name, line in pieces["front"].lines.items() if name.startswith("side")]
        ends = pieces["front"].vertices[np.concatenate([line[[0, -1]] for line in seams])]
        assert np.linalg.norm(underarm[:, None] - ends, axis=2).min() < 1e-9


def test_a_sleeves_grain_runs_over_the_arm_opposite_to_its_seam() -> None:
    for sleeve in (piece for piece in found_on(0.0).pieces if piece.name.endswith("sleeve")):
        grain = sleeve.vertices[sleeve.lines["grain"]]
        seams = [line for name, line in sleeve.lines.items() if name.startswith("underarm")]
        seam = sleeve.vertices[np.concatenate(seams)]
        # Both run along the arm; its top is as far from its underside as it is thick.
        across = np.linalg.norm(grain[:, None] - seam, axis=2).min(axis=1)
        thick = np.linalg.norm(sleeve.vertices[:, None] - seam, axis=2).min(axis=1).max()
        assert across.min() > 0.7 * thick


def test_the_grain_of_a_garment_that_leans_runs_along_its_own_middle() -> None:
    lean = np.radians(3.0)
    turn = np.array([[np.cos(lean), -np.sin(lean), 0.0], [np.sin(lean), np.cos(lean), 0.0], [0.0, 0.0, 1.0]])
    plain = lopsided(0.0)
    leaning = warpflat.make_surface(plain.vertices @ turn.T, plain.faces, name="shirt", closed=True)
    for piece in warpflat.find_seams(leaning).pieces:
        if not piece.name.endswith("sleeve"):
            ends = (piece.vertices @ turn)[piece.lines["grain"][[0, -1]]]
            assert abs(ends[1, 0] - ends[0, 0]) < 0.2 * np.sin(lean) * np.linalg.norm(ends[1] - ends[0])


def test_every_seam_has_a_price_or_a_reason() -> None:
    found = warpflat.find_seams(lopsided(0.0), warpflat.SeamOptions(no=("dart",), limit=1.0), fabric="woven")
    price = {seam.name: seam for seam in found.seams}
    assert price["underarm left"].needed == "opens a tube"
    assert price["underarm left"].released is None
    for name in ("armhole left", "side left", "shoulder right"):
        released = price[name].released
        assert price[name].needed or (released is not None and released > 0.0)
    assert any(seam.released is not None for seam in found.seams)
    assert price["armhole left"].released == price["armhole right"].released


def test_front_and_back_have_a_waist_together_where_the_trunk_is_narrowest_and_no_dart_begins_at_the_hem() -> None:
    plain = solids.skirt(rows=24, around=32)
    x, y, z = plain.vertices.T
    turn, height = np.arctan2(x / (0.28 - 0.2 * y), z / (0.2 - 0.13 * y)), 0.85 / 0.6 * y
    wide = np.interp(height, [0.0, 0.3, 0.55, 0.85], [0.19, 0.2, 0.1, 0.17])
    dress = np.column_stack([wide * np.sin(turn), height, 0.7 * wide * np.cos(turn)])
    options = warpflat.SeamOptions(no=("centre front", "centre back", "princess", "panel"), limit=0.002)
    found = warpflat.find_seams(warpflat.make_surface(dress, plain.faces, name="dress"), options, fabric="woven")
    lines = [(name, piece.vertices[line]) for piece in found.pieces for name, line in piece.lines.items()]
    waist = np.concatenate([line for name, line in lines if name.startswith("waist")])
    assert waist[:, 1] == pytest.approx(0.55, abs=0.03)
    assert waist[:, 2].min() < -0.06
    assert waist[:, 2].max() > 0.06
    darts = [line for name, line in lines if name.startswith("dart")]
    assert all(line[:, 1].min() > 0.01 for line in darts)


def test_a_seam_that_costs_nothing_is_closed_again() -> None:
    # Straight legs lie flat without the seams at their sides.
    surface = trousers()
    plain = {seam.name for seam in warpflat.find_seams(surface).seams}
    assert {"side left", "side right"} <= plain
    easy = warpflat.find_seams(surface, fabric="jersey")
    assert not {"side left", "side right"} & {seam.name for seam in easy.seams}
    assert len(easy.pieces) == 2
    assert any(note.startswith("side left, side right closed again") for note in easy.notes)


def test_a_seam_that_costs_nothing_stays_where_it_is_asked_for_or_drawn() -> None:
    asked = warpflat.find_seams(trousers(), warpflat.SeamOptions(keep=("side",)), fabric="jersey")
    assert {"side left", "side right"} <= {seam.name for seam in asked.seams}
    hip = warpflat.SeamCut(name="stripe", plane=((0.0, -0.3, 0.0), (0.0, 1.0, 0.0)))
    drawn = warpflat.find_seams(trousers(), warpflat.SeamOptions(cuts=(hip,)), fabric="jersey")
    assert any(seam.name.startswith("stripe") for seam in drawn.seams)


def test_eased_seams_are_as_long_as_each_other_and_cost_less() -> None:
    found = warpflat.find_seams(lopsided(0.0))
    pieces = [warpflat.flatten(piece, fabric="woven", datum="grain") for piece in found.pieces]
    strict, eased = (warpflat.sew_pieces(pieces, eased=eased) for eased in (False, True))
    for garment in (strict, eased):
        assert garment.sewn is not None
        assert garment.sewn.converged
        assert max(abs(seam.difference) for seam in garment.seams) < (3e-5 if garment is eased else 1e-4)
    own = sum(piece.stages[-1].strain_energy_j for piece in pieces)
    cost = [sum(p.stages[-1].strain_energy_j for p in garment.pieces.values()) - own for garment in (strict, eased)]
    assert 0.0 <= cost[1] < 0.7 * cost[0]


def test_the_command_parts_a_garment_sews_it_and_draws_mirrored_pieces_once(tmp_path: Path) -> None:
    mesh = write_obj(tmp_path / "shirt.obj", solids.shirt(step=0.045))
    arguments = ["flatten", str(mesh), "--units", "m", "--fabric", "woven", "--no-picture", "--frames", "0"]
    assert main([*arguments, "--limit", "1", "--out", str(tmp_path / "out")]) == 0
    pattern = warpflat.read_pattern_json(tmp_path / "out" / "pattern.json")
    pieces = {piece.name: piece.piece for row in pattern.pieces.values() for piece in row}
    assert set(pieces) == {"front", "back", "left_sleeve"}
    assert pieces["left_sleeve"].quantity == 2
    assert pieces["left_sleeve"].paired
    # All of the right sleeve's seams are there, at the left one's edges.
    sides = [side for seam in pattern.pattern.seams for side in seam.stretches]
    assert sum(side.mirrored for side in sides) == sum(
        side.piece == "left_sleeve" and not side.mirrored for side in sides
    )
    svg = (tmp_path / "out" / "shirt.svg").read_text(encoding="utf-8")
    assert "Cut 2, 1 mirrored" in svg
    tables = {"surface": {"file": str(mesh), "units": "m"}, "seams": {"find": "none"}}
    assert found_seams(warpflat.make_scene(tables, name="shirt", folder=tmp_path, where="test")) is None
