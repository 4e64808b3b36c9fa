"""A garment sewn, draped, measured and written."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bodies import body_of_size
from PIL import Image
from pxr import Sdf, Usd, UsdGeom
from scipy.spatial import Delaunay
from surface_meshes import cylinder, grid

import warpflat
from warpflat.app.cli.fit_lines import fit_lines
from warpflat.app.cli.tables import drape_lines
from warpflat.app.review.faults import faults_of
from warpflat.app.scene.drape import drape_scene
from warpflat.app.scene.load import load_scene
from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import grain_axes
from warpflat.flat.fabric.library import find_fabric, load_library
from warpflat.flat.flattening.verdict import judge
from warpflat.flat.model.membrane import make_cloth
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.paths.lines import with_lines
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.draping import drape_garment
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.drape_energy import DrapeEnergy
from warpflat.garment.draping.drape_garment import thread_elastics
from warpflat.garment.draping.frames import choose_frames, write_drape_frames
from warpflat.garment.draping.moved_pattern import with_pattern
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.places import Place, find_places
from warpflat.garment.draping.result import HOLLOW_REACH, hollow_depths
from warpflat.garment.draping.sewn_cloth import SewnCloth, sew_cloth


@pytest.fixture(scope="module")
def bodice() -> warpflat.Garment:
    # 20 mm cells are too stiff at the armhole: it gapes by 14 mm there, by 20 mm on cells of 10 mm.
    body = body_of_size(14.0)
    return warpflat.flatten_form(body, body.form("bodice"), fabric="woven")


@pytest.fixture(scope="module")
def worn(bodice: warpflat.Garment) -> warpflat.Drape:
    return warpflat.drape(bodice)


def test_seams_are_welded_and_the_rest_state_is_the_flat_pattern(bodice: warpflat.Garment):
    cloth = sew_cloth(bodice)
    twice = sum(len(np.unique(np.concatenate([run.vertices[0] for run in seam.runs]))) for seam in bodice.form.seams)
    pieces = bodice.pieces.values()
    assert len(cloth.designed) == sum(len(piece.positions) for piece in pieces) - twice
    np.testing.assert_allclose(cloth.vertex_areas().sum(), sum(piece.worn.area.sum() for piece in pieces), rtol=1e-12)
    laplacian, stiffness = cloth.laplacian()
    np.testing.assert_allclose((laplacian @ np.ones(len(cloth.designed))), 0.0, atol=1e-12)
    assert (stiffness > 0.0).sum() > 0.8 * len(stiffness)


def test_a_garment_of_meshes_keeps_its_seams():
    """Two halves of a bent sheet meet along a column; a tube is sewn between lines of five vertices and of nine, at those that agree."""
    points, faces = grid(9, 5, cylinder)
    left = make_surface(points, faces[np.arange(len(faces)) % 8 < 4], name="left")
    right = make_surface(points, faces[np.arange(len(faces)) % 8 >= 4], name="right")
    cloth = sew_cloth(warpflat.sew_pieces([warpflat.flatten(each, fabric="woven") for each in (left, right)]))
    assert len(cloth.designed) == len(points)
    assert sorted(map(len, border_loops(cloth.faces))) == [24]

    heights, across = np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9)
    u, v = np.meshgrid(across, heights)
    coarse = (u.ravel() == 0.0) & (np.arange(u.size) // 9 % 2 == 1)
    place = np.column_stack([u.ravel(), v.ravel()])[~coarse]
    angle = 2.0 * np.pi * place[:, 0]
    tube = np.column_stack([0.1 * np.sin(angle), 0.3 * place[:, 1], 0.1 * np.cos(angle)])
    triangles = Delaunay(place).simplices
    ends = {name: np.flatnonzero(place[:, 0] == side) for name, side in (("one", 0.0), ("other", 1.0))}
    surface = with_lines(make_surface(tube, triangles, name="tube", weld=False), ends)
    seam = SeamTable(name="seam", sides=["one", "other"])
    cloth = sew_cloth(warpflat.sew_pieces([warpflat.flatten(surface, fabric="woven")], seams=[seam]))
    assert len(cloth.designed) == len(place) - 5


def no_strains(faces: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.zeros(len(faces)) for name in ("warp", "weft", "shear")}


def test_what_has_sunk_to_the_legs_of_the_body_that_wears_it_has_fallen_off(monkeypatch: pytest.MonkeyPatch):
    """Whether the garment was made on a body, as a form is, or on none, as a piece of a mesh."""
    legs, hips = list[float](), list[float]()

    def relax(*_: object, **given: Any) -> SimpleNamespace:
        legs.append(given["legs"])
        return SimpleNamespace(check_held=lambda: None)

    monkeypatch.setattr(drape_garment, "relax_drape", relax)
    own, other = body_of_size(30.0), body_of_size(30.0, "EU 46")
    piece = warpflat.flatten(make_surface(*grid(9, 5, cylinder), name="tube"), fabric="woven")
    form = warpflat.flatten_form(own, own.form("skirt"), fabric="woven", sewn=False)
    for garment, body in ((piece, None), (piece, other), (form, None), (form, other)):
        hips.append(warpflat.drape(garment, body).hangs_below)
    assert legs == [-np.inf, *(each.line("thigh")[:, 1].mean() for each in (other, own, other))]
    # It hangs below the hip of the body that it was made on, or of that which wears it, where it was made on none.
    assert hips == [-np.inf, *(each.line("hip")[:, 1].mean() for each in (other, own, own))]


def test_cloth_gapes_at_its_edges_and_stands_off_inside(worn: warpflat.Drape):
    cloth, borders = worn.cloth, np.concatenate(border_loops(worn.cloth.faces))
    away = np.linalg.norm(cloth.designed[:, None] - cloth.designed[borders], axis=2).min(axis=1)
    for vertex, words in (
        (int(away.argmax()), "stands off 20.0 mm from the designed surface,"),
        (int(borders[0]), "gapes by 25.0 mm, 20.0 mm of it misfit, over"),
    ):
        near = np.linalg.norm(cloth.designed - cloth.designed[vertex], axis=1) < 0.05
        lift, none = np.where(near, 0.02, 0.0), np.zeros(len(near))
        (place,) = find_places(
            cloth,
            worn.areas,
            misfit=lift,
            meant_to_touch=near,
            bridged=none,
            lift=lift,
            # Cloth that was designed 5 mm off the body.
            gap=lift + 0.005,
            strains=no_strains(cloth.faces),
            gathered=near & False,
            compared_with="designed surface",
        )
        assert words in place.words


def test_a_place_at_a_dart_is_called_by_the_dart(worn: warpflat.Drape):
    """Its legs are edges, "waist dart left.left" and "waist dart left.right"."""
    leg, none = next(iter(worn.cloth.lines.values())), np.zeros(len(worn.cloth.designed))
    cloth = dataclasses.replace(worn.cloth, lines={"front.waist dart left.left": leg})
    near = np.linalg.norm(cloth.designed - cloth.designed[leg[1]], axis=1) < 0.05
    misfit = np.where(near, 0.02, 0.0)
    (place,) = find_places(
        cloth, worn.areas, misfit=misfit, meant_to_touch=near, bridged=none, lift=-misfit, gap=none, strains=no_strains(cloth.faces),
        gathered=near & False, compared_with="designed surface",
    )  # fmt: skip
    assert place.words.startswith("front near waist dart left falls in")


def test_a_place_is_told_once():
    """The verdict tells the five worst."""
    words = [f"the cloth stands off {number} mm" for number in range(6)]
    drape = {
        "converged": True, "compared_with": "body", "distance_m": {"mean": 0.002}, "misfit_m": {"mean": 0.001, "p95": 0.002, "max": 0.003},
        "places": [{"kind": "misfit", "fails": False, "words": each} for each in words],
    }  # fmt: skip
    metrics: dict[str, Any] = {"pieces": {}, "drape": drape}
    verdict = judge(metrics)
    assert verdict is not None
    metrics["verdict"] = verdict.as_dict()
    lines = [*fit_lines(metrics), *drape_lines(metrics)]
    assert [sum(each in line for line in lines) for each in words] == [1] * 6


def test_a_place_that_goes_on_into_another_piece_names_both(worn: warpflat.Drape):
    """Its area may be larger than that of the piece that its worst vertex lies in."""
    cloth, ones = worn.cloth, np.ones(len(worn.cloth.designed))
    both = {name: np.isin(np.arange(len(ones)), cloth.welded[rows]) for name, rows in cloth.piece_vertices.items()}
    for near, said in ((ones > 0.0, " of front and back"), (both["front"] & ~both["back"], "")):
        lift = np.where(near, 0.02, 0.0)
        (place,) = find_places(
            cloth, worn.areas, misfit=lift, meant_to_touch=near, bridged=0.0 * ones, lift=-lift, gap=0.0 * ones,
            strains=no_strains(cloth.faces), gathered=ones < 0.0, compared_with="designed surface",
        )  # fmt: skip
        assert place.words.endswith(f"falls in by 20.0 mm over {1e4 * worn.areas[near].sum():,.0f} cm2{said}")


@pytest.mark.parametrize(
    ("faces", "words"),
    [
        ([[0, 1, 2], [0, 1, 3]], "gapes"),
        ([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "stands off 20.0 mm from the body,"),
    ],
    ids=["sewn twisted", "closed"],
)
def test_cloth_without_loops_around_it_has_places_too(faces: list[list[int]], words: str):
    """A seam that joins right sides to wrong ones leaves borders that do not follow each other; a ball has none."""
    faces4, ones = np.column_stack([np.array(faces, dtype=np.int32), np.full(len(faces), -1, np.int32)]), np.ones(4)
    cloth = SewnCloth(
        fabric=warpflat.find_fabric("woven"), designed=0.1 * np.eye(4, 3), faces=faces4, flat_faces=faces4,
        flat=0.1 * np.eye(4, 2), welded=np.arange(4), warp=np.zeros((len(faces), 2)), weft=np.zeros((len(faces), 2)),
        piece_faces={"front": slice(0, len(faces))}, piece_vertices={"front": slice(0, 4)},
        lines={"front.hem": np.array([0, 1])},
    )  # fmt: skip
    (place,) = find_places(
        cloth, 0.01 * ones, misfit=0.02 * ones, meant_to_touch=ones > 0.0, bridged=0.0 * ones, lift=0.02 * ones,
        gap=0.02 * ones, strains=no_strains(faces4), gathered=ones < 0.0, compared_with="body",
    )  # fmt: skip
    assert words in place.words


def test_a_bodice_without_darts_gapes_at_the_armholes(worn: warpflat.Drape):
    measures = worn.measures()
    assert measures["converged"]
    assert measures["residual"] <= 5e-3
    assert measures["deepest_m"] < 1e-4
    for side in ("left", "right"):
        assert measures["gap_m"][f"front.armhole {side}"] > 0.015
        assert measures["gap_m"][f"back.armhole {side}"] < 0.003
    np.testing.assert_allclose(worn.misfit + worn.bridged, worn.distance)
    worst = measures["places"][0]
    assert worst["kind"] == "misfit"
    assert "armhole" in worst["line"]
    assert f"gapes by {1e3 * worst['gap_m']:.1f} mm" in worst["words"]
    assert worst["fails"]
    # What presses on the body carries the weight that does not hang from friction alone.
    assert worn.pressure[worn.gap > 2e-3].max() == 0.0


def test_cloth_that_hangs_is_described_and_no_misfit(worn: warpflat.Drape):
    place = worn.places[0]
    assert (place.kind, worn.meant_to_touch[place.vertex]) == ("misfit", True)
    # Cloth that takes up its ease is no misfit, wherever it lies.
    assert not worn.meant_to_touch[worn.gap < worn.designed_gap].any()
    # Under the height below which it hangs, the same place is told as such.
    hanging = dataclasses.replace(worn, hangs_below=float(worn.cloth.designed[:, 1].max()) + 0.1)
    kinds = {each.kind for each in hanging.places}
    assert "hang" in kinds
    assert "misfit" not in kinds
    (same,) = [each for each in hanging.places if each.vertex == place.vertex]
    assert "stands off" in same.words
    assert "may take it up" not in same.words


def test_a_misfit_names_the_cut_that_may_take_it_up(worn: warpflat.Drape):
    place = worn.places[0]
    at = worn.cloth.designed[place.vertex]
    near, far = (at[None] - np.array([[0.0, below, 0.0]]) for below in (0.05, 0.5))
    cuts = {"front": [("a dart along waist", far), ("a dart along bust", near)], "back": [("a seam", at[None])]}
    advised = dataclasses.replace(worn, cuts=cuts)
    assert advised.places[0].words == f"{place.words}; a dart along bust may take it up"
    assert dataclasses.replace(worn, cuts={"front": [("a dart", far)]}).places[0].words == place.words


def test_frames_are_chosen_half_by_displacement_and_half_by_time():
    # Fast for a quarter of the time, then slow.
    moves = np.repeat([1.0, 0.01], [50, 150])
    chosen = choose_frames(np.append(0.0, np.cumsum(moves)).astype(np.float32)[:, None, None])
    assert (chosen[0], chosen[-1]) == (0, 200)
    assert 0.5 < np.mean(np.array(chosen) <= 50) < 0.7


def test_a_drape_writes_worn_pieces_and_a_picture(worn: warpflat.Drape, tmp_path: Path):
    names = warpflat.save_drape(worn, tmp_path, frames=True)
    assert names == ["front.draped.obj", "back.draped.obj", "drape.png", "frames.usdc", "drape.webp"]
    rows = [line.split() for line in (tmp_path / names[0]).read_text().splitlines()]
    space = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    np.testing.assert_array_equal(space, worn.positions[worn.cloth.welded[worn.cloth.piece_vertices["front"]]])
    assert (tmp_path / "drape.png").stat().st_size > 10_000
    chosen = choose_frames(worn.frames)
    with Image.open(tmp_path / "drape.webp") as film:
        # WebP keeps two equal pictures in a row as one that is shown for as long as both.
        assert 2 <= film.n_frames <= len(chosen) <= 30
        shown = []
        for number in range(film.n_frames):
            film.seek(number)
            film.load()
            shown.append(film.info["duration"])
        assert sum(shown) == (len(chosen) - 1) * (1000 // 12) + 2000
    stage = Usd.Stage.Open(str(tmp_path / "frames.usdc"))
    cloth = UsdGeom.Mesh(stage.GetPrimAtPath("/World/drape/cloth")).GetPointsAttr()
    times = cloth.GetTimeSamples()
    assert len(times) == len(chosen)
    assert times[-1] == stage.GetEndTimeCode()
    np.testing.assert_array_equal(np.array(cloth.Get(times[0])), worn.cloth.designed.astype(np.float32))
    np.testing.assert_array_equal(np.array(cloth.Get(times[-1])), worn.positions.astype(np.float32))
    assert stage.GetPrimAtPath("/World/drape").GetAttribute("warpflat:stage").Get(times[0]) == "drape"


def test_frames_that_refer_to_a_file_not_yet_there_are_added_to_silently(
    worn: warpflat.Drape, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    path = tmp_path / "frames.usdc"
    layer = Sdf.Layer.CreateNew(str(path))
    layer.endTimeCode = 7
    body = Sdf.CreatePrimInLayer(layer, "/World/mannequin")
    body.referenceList.prependedItems.append(Sdf.Reference("mannequin.usdc"))
    layer.Save()
    write_drape_frames(path, worn)
    assert capfd.readouterr().err == ""
    written = Sdf.Layer.FindOrOpen(str(path))
    written.Reload()
    assert written.GetPrimAtPath("/World/mannequin").referenceList.prependedItems[0].assetPath == "mannequin.usdc"
    assert written.ListTimeSamplesForPath("/World/drape/cloth.points")[0] == 8


@pytest.mark.parametrize("before", [0, 7], ids=["alone", "after a run's frames"])
def test_a_drape_takes_the_place_of_an_earlier_one_in_its_film(worn: warpflat.Drape, tmp_path: Path, before: int):
    """The second drape of a pattern into a folder was put after the first, and the third could not be written."""
    path = tmp_path / "frames.usdc"
    if before:
        layer = Sdf.Layer.CreateNew(str(path))
        layer.endTimeCode = before
        Sdf.CreatePrimInLayer(layer, "/World/front")
        layer.Save()
    ends = []
    for _ in range(3):
        write_drape_frames(path, worn)
        written = Sdf.Layer.FindOrOpen(str(path))
        written.Reload()
        ends.append(written.endTimeCode)
        assert written.ListTimeSamplesForPath("/World/drape/cloth.points")[0] == before + 1
        assert bool(written.GetPrimAtPath("/World/front")) == (before > 0)
    assert len(set(ends)) == 1


def test_a_cut_is_closed_again():
    surface = warpflat.make_shape("dome", resolution=17)
    piece = warpflat.flatten(surface, fabric="woven")
    line = next(iter(piece.surface.lines))
    cut = warpflat.cut(
        piece, warpflat.CutPlan(name="dart", paths=(warpflat.line_part(piece.surface, line, (0.0, 0.4)),))
    )
    assert len(cut.positions) > len(piece.positions)
    assert len(sew_cloth(cut).designed) == len(piece.positions)


def test_a_hollow_is_as_deep_as_taut_cloth_stands_off():
    """A groove of depth d and half width b: over its middle d, at half its width d / 2; a ridge has none."""
    across, along = (each.ravel() for each in np.meshgrid(np.linspace(-0.1, 0.1, 41), np.linspace(-0.1, 0.1, 21)))
    depth, half = 0.01, 0.05
    groove = -depth * np.maximum(1.0 - np.abs(across) / half, 0.0)
    up = np.tile([0.0, 0.0, 1.0], (len(across), 1))
    middle = np.flatnonzero((np.abs(along) < 1e-9) & np.isin(np.round(across, 3), (0.0, 0.025, 0.07)))
    found = hollow_depths(np.column_stack([across, along, groove]), up, middle)
    np.testing.assert_allclose(found, [depth, depth / 2, 0.0], atol=1e-5)
    np.testing.assert_allclose(hollow_depths(np.column_stack([across, along, -groove]), up, middle)[0], 0.0, atol=1e-5)
    assert half < HOLLOW_REACH


def test_what_cannot_be_draped_is_refused(bodice: warpflat.Garment):
    with pytest.raises(InputError, match=r"line 'shoulder lefd' is unknown: did you mean 'shoulder left'"):
        warpflat.drape(bodice, hold=["shoulder lefd"])
    front, back = bodice.pieces.values()
    other = dataclasses.replace(back, fabric=warpflat.find_fabric("denim"))
    with pytest.raises(InputError, match=r"different cloths \(denim and woven\)"):
        warpflat.drape([front, other])
    half = bodice.mannequin.form("bodice", half=True)
    with pytest.raises(InputError, match="half a piece on the fold"):
        warpflat.drape(dataclasses.replace(bodice, form=half))
    with pytest.raises(InputError, match="there is no piece"):
        warpflat.drape([])
    with pytest.raises(InputError, match="friction = -1"):
        warpflat.DrapeOptions(friction=-1.0)
    with pytest.raises(InputError, match=r"max_steps = 5000\.0; must be a whole number"):
        warpflat.DrapeOptions(max_steps=5e3)


def test_a_scene_with_a_drape_reports_it(tmp_path: Path):
    text = 'fabric = "woven"\n[surface]\nshape = "dome"\nresolution = 13\n[drape]\nmax_steps = 300\n'
    path = tmp_path / "dome.toml"
    path.write_text(text + "[output]\nframes = 0\n[pattern]\nformats = []\n")
    result = warpflat.run_scene(warpflat.load_scene(path), tmp_path / "out")
    assert {"dome.draped.obj", "drape.png"} <= set(result.files)
    entry = json.loads((tmp_path / "out" / "metrics.json").read_text())["drape"]
    assert entry["steps"] <= 300
    fallen = {**result.metrics, "drape": {**entry, "converged": False, "distance_m": {"mean": 2.0}}}
    assert any("slipped off its body" in line for line in faults_of(fallen))
    assert {"distance_m", "misfit_m", "bridged_m", "gap_m", "strain_warp", "pressure_pa", "places"} <= set(entry)


def test_a_corrected_pattern_halves_the_misfit_and_keeps_its_seams():
    # In woven cloth a twentieth of it is strained beyond its limit, and how far a round goes before more is hangs on rounding.
    body = body_of_size(14.0)
    bodice = warpflat.flatten_form(body, body.form("bodice"), fabric="interlock")
    worn = warpflat.drape(bodice)
    found = warpflat.correct_pattern(worn, rounds=2)
    assert found.after.converged
    assert found.rounds[-1].misfit < 0.5 * found.rounds[0].misfit
    assert found.rounds[0].misfit == pytest.approx(worn.measures()["misfit_m"]["mean"])
    assert found.seam_difference() < 5e-5
    new = found.apply(bodice)
    assert isinstance(new, warpflat.Garment)
    # Without darts the armhole gapes: it must become shorter.
    edges = found.edges(bodice)
    for side in ("left", "right"):
        assert -0.02 < edges[f"front.armhole {side}"]["longer_m"] < -0.002
    for name, piece in new.pieces.items():
        moved = np.linalg.norm(piece.positions - bodice.pieces[name].positions, axis=1)
        assert 1e-3 < moved.max() < 0.03
    # What is draped again is what was found.
    again = warpflat.drape(new)
    np.testing.assert_allclose(again.positions, found.after.positions, atol=1e-9)


def test_a_pattern_is_not_corrected_from_another_cloth_that_is_not_at_rest(worn: warpflat.Drape):
    hurried = dataclasses.replace(worn, options=warpflat.DrapeOptions(max_steps=100))
    for other in ({"fabric": find_fabric("denim")}, {"worn_shape": True, "fabric": find_fabric("denim")}):
        with pytest.raises(InputError, match="the drape in denim is not at rest"):
            warpflat.correct_pattern(hurried, rounds=0, **other)


class _Cylinder:
    """The gaps from an upright cylinder, in the place of a body's mesh."""

    def __init__(self, radius: float) -> None:
        self.radius = radius

    def gaps(self, points: FloatArray) -> FloatArray:
        return np.hypot(points[:, 0], points[:, 2]) - self.radius


def _tube(worn: warpflat.Drape, radius: float, gaps: FloatArray, offset: FloatArray) -> warpflat.Drape:
    """Return a tube of cloth around a cylinder, designed so far off it by rows [m], and moved by so much (3 or #V by 3 [m])."""
    around, rows = 32, len(gaps)
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    unit = np.column_stack([np.sin(angle), np.zeros(around), np.cos(angle)])
    designed = np.concatenate([(radius + gap) * unit + [0.0, -0.02 * row, 0.0] for row, gap in enumerate(gaps)])
    grid = np.arange(rows * around).reshape(rows, around)
    beside = np.roll(grid, -1, axis=1)
    faces = np.stack([grid[1:], beside[1:], beside[:-1], grid[:-1]], axis=-1).reshape(-1, 4)
    areas = np.ones(len(designed))
    cloth = SimpleNamespace(designed=designed, faces=faces, vertex_areas=lambda: areas)
    moved = dataclasses.replace(worn.worn, positions=designed + offset)
    body, form = _Cylinder(radius), _Cylinder(radius + float(gaps.min()))
    return dataclasses.replace(worn, cloth=cloth, worn=moved, body=body, designed=form, hangs_below=-np.inf)  # type: ignore[arg-type]


def test_cloth_hangs_from_where_it_was_designed_to_leave_the_body(worn: warpflat.Drape):
    # Fitted, loose, and near the body again: all of it stands off by another 8 mm.
    gaps = np.repeat([0.002, 0.02, 0.002], 8)
    off = _tube(worn, 0.15, gaps, np.zeros(3)).cloth.designed * np.array([1.0, 0.0, 1.0])
    off *= 0.008 / np.linalg.norm(off, axis=1, keepdims=True)
    touches = _tube(worn, 0.15, gaps, off).meant_to_touch
    assert touches[: 8 * 32].all()
    assert not touches[8 * 32 :].any()


@pytest.mark.parametrize("moved", [True, False])
def test_ease_that_has_moved_is_no_misfit(worn: warpflat.Drape, moved: bool):
    # Around an arm: pushed to one side it stands off there, too wide it does all around.
    gaps = np.full(16, 0.006)
    off = np.array([0.005, 0.0, 0.0])
    if not moved:
        off = _tube(worn, 0.04, gaps, np.zeros(3)).cloth.designed * np.array([1.0, 0.0, 1.0])
        off *= 0.005 / np.linalg.norm(off, axis=1, keepdims=True)
    tube = _tube(worn, 0.04, gaps, off)
    aside = tube.gap > tube.designed_gap + 0.004
    assert aside.sum() > 16
    assert tube.meant_to_touch[aside].all() != moved
    assert tube.meant_to_touch[aside].any() != moved


def test_small_folds_are_told_and_overstretched_cloth_counts(worn: warpflat.Drape):
    def fits(kind: str, worst: float, area: float, line: str = "front.armhole left", gapes: bool = True) -> bool:
        place = Place(kind=kind, line=line, worst=worst, gap=0.0, area=area, words="", vertex=0, gapes=gapes)
        return not worn._fails(place)

    assert fits("strain", -0.3, 1.0)
    assert not fits("strain", 0.3, 8e-4)
    assert fits("shear", 30.0, 8e-4)
    assert not fits("shear", 30.0, 12e-4)
    assert fits("misfit", 0.01, 8e-4)
    assert not fits("misfit", 0.01, 12e-4)
    # Elsewhere, and where it does not gape, it is told.
    assert fits("misfit", 0.01, 12e-4, line="front.hem")
    assert fits("misfit", 0.01, 12e-4, gapes=False)
    assert fits("hang", 0.01, 1.0)


def test_cloth_sheared_beyond_its_limit_does_not_fit(worn: warpflat.Drape):
    """A band of the cloth a tenth below the limit is told nothing of; a tenth above it is a place of its own, and no fit."""
    cloth, limit = worn.cloth, worn.cloth.fabric.shear_limit
    band = np.abs(cloth.designed[cloth.faces[:, 0], 1] - np.median(cloth.designed[:, 1])) < 0.1
    for share in (0.9, -0.9, 1.1, -1.1):
        sheared = dataclasses.replace(worn, worn=dataclasses.replace(worn.worn, converged=True))
        vars(sheared)["strains"] = {**no_strains(cloth.faces), "shear": np.where(band, share * limit, 0.0)}
        vars(sheared)["_off"] = np.zeros(len(cloth.designed))
        places = [place for place in sheared.places if place.kind == "shear"]
        area = worn.face_areas[band].sum() / worn.face_areas.sum()
        assert sheared.measures()["outside"] == (pytest.approx(area) if abs(share) > 1.0 else 0.0)
        assert any(place.fails for place in sheared.places) == (abs(share) > 1.0)
        assert bool(places) == (abs(share) > 1.0)
        for place in places:
            assert (
                f"is sheared by {1.1 * limit:.1f} degrees, beyond the cloth's limit of {limit:g} degrees" in place.words
            )


def test_a_pattern_in_another_cloth_is_judged_by_that_cloth(bodice: warpflat.Garment, worn: warpflat.Drape):
    silk = next(cloth for cloth in load_library().values() if cloth.name != "woven" and not cloth.is_knit)
    changed = with_pattern(bodice, dataclasses.replace(worn.cloth, fabric=silk))
    for piece in changed.pieces.values():
        assert piece.network.fabric is piece.fabric is silk
        assert piece.fit.demand.fabric in (silk, silk.name)


def test_a_sheet_without_threads_has_none_that_lock():
    paper, woven = find_fabric("isotropic"), find_fabric("woven")
    assert [make_cloth(cloth, grain_axes(0.0), "cpu").lock for cloth in (paper, woven)] == [
        0.0,
        10.0 * woven.shear_stiffness,
    ]


def test_beyond_the_bound_of_a_round_no_force_is_as_good_as_none(worn: warpflat.Drape):
    energy = DrapeEnergy(worn.cloth, None, DrapeOptions(), np.zeros(len(worn.cloth.designed), bool))
    energy.bound(worn.cloth.designed, 0.1)
    assert np.isfinite(energy.mean_force(energy.at(worn.cloth.designed)))
    assert energy.mean_force(energy.at(worn.cloth.designed + 0.11)) == np.inf


def test_what_an_elastic_gathers_is_told_and_no_strain(bodice: warpflat.Garment, worn: warpflat.Drape):
    cloth = worn.cloth
    body = Body(cloth.designed * [0.9, 1.0, 0.9], cloth.faces, device=worn.body.device)
    drawn, held = thread_elastics(cloth, ["waist"], body)
    assert held == [line for line in cloth.lines if line.partition(".")[2] == "waist"]
    rows = np.unique(np.concatenate([cloth.lines[line] for line in held]))
    others = np.setdiff1d(np.arange(len(cloth.designed)), rows)
    np.testing.assert_array_equal(drawn.designed[others], cloth.designed[others])
    np.testing.assert_allclose(drawn.designed[rows, 1], cloth.designed[rows, 1], atol=1e-9)
    assert np.abs(body.gaps(drawn.designed[rows])).max() < 1e-3 < body.gaps(cloth.designed[rows]).min()
    # The cells above the waist pressed together, half of them.
    pressed = dataclasses.replace(worn, threaded=held)
    strain = np.where(np.isin(cloth.faces, rows).any(axis=1), -0.5, 0.0)
    vars(pressed)["strains"] = {"warp": 0.0 * strain, "weft": strain, "shear": 0.0 * strain}
    vars(pressed)["misfit"] = np.zeros(len(cloth.designed))
    gathered = [place for place in pressed.places if "gathered by its elastic" in place.words]
    assert gathered
    assert {place.kind for place in gathered} == {"hang"}
    assert not any(place.kind == "strain" for place in pressed.places)
    vars(other := dataclasses.replace(worn))["strains"] = vars(pressed)["strains"]
    assert any(place.kind == "strain" for place in other.places)


def test_a_scene_threads_the_elastics_of_its_finishings(monkeypatch: pytest.MonkeyPatch):
    seen: list[Sequence[str]] = []
    monkeypatch.setattr("warpflat.garment.drape", lambda *_, elastics, **__: seen.append(elastics))
    scenes = Path(__file__).parents[3] / "scenes"
    for name in ("pyjama_trousers", "trousers"):
        drape_scene(load_scene(scenes / f"{name}.toml"), None)  # type: ignore[arg-type]
    assert seen == [["waist"], []]
