"""Tightness: Laplace's law on cylinders, patterns of the closed-form size, and what does not fit."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from devices import DEVICE

import warpflat
from warpflat.app.cli.fit_lines import fit_lines
from warpflat.app.scene.load import load_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.fit_report import garment_wear
from warpflat.flat.flattening.verdict import judge
from warpflat.flat.model.fit import MAPS, assess_pattern
from warpflat.flat.model.wear import Wear, intended_stretch
from warpflat.flat.surface.curvature import curvature_tensors
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.lines import with_lines
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.pattern.export.figure import Pixels
from warpflat.pattern.export.fit_picture import write_wear_sheet

RADIUS, HEIGHT = 0.06, 0.3
NET = find_fabric("power-net")


def sleeve(**options: object) -> warpflat.Surface:
    return make_shape("cylinder", radius=RADIUS, height=HEIGHT, angle=300.0, **options)


def girth(surface: warpflat.Surface) -> float:
    """Of the polygon that the mesh makes of the circle."""
    return float(np.linalg.norm(np.diff(surface.vertices[surface.lines["bottom"]], axis=0), axis=1).sum())


@pytest.mark.parametrize(("model", "triangles"), [("springs", False), ("membrane", False), ("membrane", True)])
def test_a_stretched_cylinder_has_the_closed_form_pattern_and_laplace_s_pressure(model: str, triangles: bool):
    surface = sleeve(triangles=triangles)
    result = warpflat.flatten(
        surface, fabric=NET, datum="centre", model=model, wear=Wear(stretch_weft=0.2), device=DEVICE
    )
    width, height = np.ptp(result.positions, axis=0)
    assert width == pytest.approx(girth(surface) / 1.2, rel=1e-6)
    assert height == pytest.approx(HEIGHT, rel=1e-6)
    fit = result.fit
    tension = 0.2 * NET.stiffness_weft
    np.testing.assert_allclose(fit.strain_weft, 0.2, atol=1e-6)
    np.testing.assert_allclose(fit.tension_weft, tension, rtol=1e-5)
    np.testing.assert_allclose(fit.pressure, tension / RADIUS, rtol=0.01)
    assert fit.within_limits
    assert result.measures["model_energy_j"] < 1e-9
    assert result.measures["strain_energy_j"] == pytest.approx(
        0.5 * NET.stiffness_weft * 0.2**2 * width * height, rel=1e-5
    )


def test_tension_is_per_width_of_the_cloth_as_worn():
    wear = Wear(stretch_warp=0.1, stretch_weft=0.2)
    result = warpflat.flatten(sleeve(), fabric=NET, datum="centre", wear=wear, device=DEVICE)
    assert np.ptp(result.positions[:, 1]) == pytest.approx(HEIGHT / 1.1, rel=1e-6)
    expected = 0.2 * NET.stiffness_weft / 1.1
    assert float(np.median(result.fit.tension_weft)) == pytest.approx(expected, rel=1e-5)
    np.testing.assert_allclose(result.fit.pressure, expected / RADIUS, rtol=0.01)


def test_the_pressure_of_sheared_and_stretched_cloth_is_that_of_its_stress():
    """Cauchy's stress around the cylinder over its radius, by sigma = P F^T / J."""
    net = warpflat.Fabric(
        name="net", stiffness_warp=1000.0, stiffness_weft=800.0, shear_stiffness=700.0, areal_density=0.1, strain_limit=0.5
    )  # fmt: skip
    flat = warpflat.flatten(sleeve(), fabric=net, datum="centre", device=DEVICE).positions
    worn = np.array([[1.1, 0.1], [0.0, 1.3]])
    fit = assess_pattern(sleeve(), net, flat @ np.linalg.inv(worn).T)
    weft, warp = worn.T
    long_weft, long_warp = np.linalg.norm(weft), np.linalg.norm(warp)
    around = (
        800.0 * (long_weft - 1.0) * weft[0] ** 2 / long_weft + 1000.0 * (long_warp - 1.0) * warp[0] ** 2 / long_warp
    )
    around += 2.0 * 700.0 * (weft @ warp) * weft[0] * warp[0]
    np.testing.assert_allclose(fit.pressure, around / np.linalg.det(worn) / RADIUS, rtol=0.01)


def test_a_pressure_is_reached_beside_a_stretch_of_the_other_threads():
    wear = Wear(pressure=800.0, stretch_warp=0.1)
    result = warpflat.flatten(sleeve(), fabric=NET, datum="centre", wear=wear, device=DEVICE)
    np.testing.assert_allclose(result.fit.strain_warp, 0.1, atol=1e-3)
    np.testing.assert_allclose(result.fit.pressure, 800.0, rtol=0.02)


@pytest.mark.parametrize("model", ["springs", "membrane"])
def test_a_cone_gets_the_pressure_asked_for(model: str):
    surface = make_shape("cone", bottom=0.03, top=0.04, height=0.2, angle=300.0)
    wear = Wear(pressure=800.0)
    result = warpflat.flatten(surface, fabric=NET, datum="centre", model=model, wear=wear, device=DEVICE)
    np.testing.assert_allclose(result.fit.pressure, 800.0, rtol=0.03)
    # p = T / r along the girth: the wide end is stretched more.
    radius = np.hypot(*surface.vertices[surface.faces].mean(axis=1)[:, [0, 2]].T)
    assert np.corrcoef(radius, result.fit.strain_weft)[0, 1] > 0.99
    assert any("weft, which runs around" in note for note in result.notes)


def test_threads_that_run_around_are_found_and_a_pressure_out_of_reach_is_told():
    result = warpflat.flatten(
        sleeve(resolution=17), fabric=NET, datum="bottom", wear=Wear(pressure=5000.0), device=DEVICE
    )
    assert any("along warp, which runs around" in note for note in result.notes)
    assert any("cannot be reached within power-net's limit of 30 %" in note for note in result.notes)
    assert result.fit.strain_warp.max() == pytest.approx(NET.strain_limit, rel=1e-3)


def test_a_stretch_that_the_pressure_overrides_is_refused():
    with pytest.raises(InputError, match=r"give stretch_warp or stretch_weft, that of the other threads, not both"):
        Wear(pressure=1000.0, stretch_warp=0.1, stretch_weft=0.1)
    wear, told = Wear(pressure=1000.0, stretch_weft=0.1), r"stretch_weft = 0.1 has no effect: weft runs around the body"
    with pytest.raises(InputError, match=rf"piece 'cylinder': wear: {told}.*; leave it out, or the pressure"):
        warpflat.flatten(sleeve(), fabric=NET, datum="centre", wear=wear, device=DEVICE)
    # Of several pieces each has its own threads around the body.
    (piece,) = warpflat.flatten_all([sleeve()], fabric=NET, datum="centre", wear=wear, device=DEVICE)
    assert any(note.startswith("stretch_weft = 0.1 has no effect") for note in piece.notes)
    used = warpflat.flatten(
        sleeve(), fabric=NET, datum="centre", wear=Wear(pressure=1000.0, stretch_warp=0.1), device=DEVICE
    )
    assert not any("no effect" in note for note in used.notes)


def test_a_given_pattern_is_judged():
    surface = sleeve(resolution=17)
    flat = warpflat.flatten(surface, fabric="denim", datum="centre", device=DEVICE).positions
    denim = find_fabric("denim")
    assert assess_pattern(surface, denim, flat).within_limits
    tight = assess_pattern(surface, denim, flat * [0.92, 1.0])
    assert not tight.within_limits
    assert tight.outside == pytest.approx(1.0)
    assert tight.misfits[0].worst.value == pytest.approx(1 / 0.92 - 1, rel=1e-6)
    assert "stretched 8.7 % along weft (limit 5 %)" in tight.misfits[0].words
    loose = assess_pattern(surface, denim, flat * [1.08, 1.0])
    assert "slack 7.4 % along weft" in loose.misfits[0].words
    assert loose.pressure.max() == 0.0
    assert loose.hollow == pytest.approx(1.0)
    with pytest.raises(InputError, match=r"pattern has shape \(3, 2\); must be \(289, 2\)"):
        assess_pattern(surface, denim, flat[:3])


def sheared(degrees: float, *, triangles: bool, longer: float = 0.0) -> Surface:
    """A square of 0.1 m whose threads keep their lengths, or all grow by a share, and turn from the right angle by some degrees."""
    angle, length = math.radians(90.0 - degrees), 0.1 * (1.0 + longer)
    x, y = length * math.cos(angle), length * math.sin(angle)
    faces = [[0, 1, 2], [0, 2, 3]] if triangles else [[0, 1, 2, 3]]
    return make_surface([[0, 0, 0], [length, 0, 0], [length + x, y, 0], [x, y, 0]], faces)


SQUARE = [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("fabric", ["woven", "denim", "interlock", "power-net"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_cloth_fits_up_to_its_limit_of_shear_and_not_beyond(fabric: str, triangles: bool, sign: float):
    cloth = find_fabric(fabric)
    within = assess_pattern(sheared(sign * 0.9 * cloth.shear_limit, triangles=triangles), cloth, SQUARE)
    assert within.within_limits
    assert within.outside == 0.0
    np.testing.assert_allclose(within.shear, sign * 0.9 * cloth.shear_limit, rtol=1e-9)
    np.testing.assert_allclose(within.strain_warp, 0.0, atol=1e-9)
    beyond = assess_pattern(sheared(sign * 1.1 * cloth.shear_limit, triangles=triangles), cloth, SQUARE)
    assert beyond.outside == pytest.approx(1.0)
    words = f"sheared {1.1 * cloth.shear_limit:.1f} degrees (limit {cloth.shear_limit:.3g} degrees), "
    assert beyond.misfits[0].words.startswith(words)
    # What its maker allows is the limit.
    assert assess_pattern(
        sheared(1.1 * cloth.shear_limit, triangles=triangles),
        replace(cloth, shear_limit=1.2 * cloth.shear_limit),
        SQUARE,
    ).within_limits


def test_a_place_beyond_both_limits_counts_once():
    woven = find_fabric("woven")
    both = assess_pattern(sheared(1.1 * woven.shear_limit, triangles=False, longer=0.06), woven, SQUARE)
    assert both.outside == pytest.approx(1.0)
    assert len(both.misfits) == 1
    # The worse of both is told: the threads are 1.2 times at their limit.
    assert both.misfits[0].words.startswith("stretched 6.0 % along w")


@pytest.mark.parametrize("turn", [0.0, 45.0])
def test_an_isotropic_sheet_has_no_threads_and_is_judged_by_its_principal_strains(turn: float):
    """The same strain along the grain and across it: sheared by g, a diagonal is sqrt(1 + sin g) - 1 longer."""
    sheet = find_fabric("isotropic")
    for share in (0.9, 1.1):
        shear = math.degrees(math.asin(1.0 - (1.0 - share * sheet.strain_limit) ** 2))
        fit = assess_pattern(sheared(shear, triangles=False), sheet, SQUARE, grain_angle=turn)
        assert fit.outside == pytest.approx(float(share > 1.0))
        assert fit.shear_limit is None
    assert fit.misfits[0].words.startswith("slack 5.5 % (limit 5 %), ")


@pytest.mark.parametrize(
    ("wear", "message"),
    [
        ({"stretch_weft": -0.1}, r"wear: stretch_weft = -0.1; must be 0 to 2"),
        ({"stretch_warp": 20.0}, r"stretch_warp = 20; must be 0 to 2 \(if that is in percent, write 0.2"),
        ({"pressure": 1e9}, r"wear: pressure = 1e\+09 Pa; must be 0 to 20000 Pa"),
        ({"stretch_warp": float("nan")}, r"stretch_warp = nan is not a number"),
        ({"pressure": "high"}, r"pressure = 'high' is not a number"),
    ],
)
def test_impossible_wishes_are_refused_by_name(wear: dict[str, object], message: str):
    with pytest.raises(InputError, match=message):
        Wear(**wear)  # type: ignore[arg-type]


def test_wishes_may_be_numbers_of_numpy():
    assert Wear(stretch_weft=np.float32(0.125), stretch_warp=np.int64(0)).is_tight  # type: ignore[arg-type]


# --- curvature


def test_curvature_of_spheres_cylinders_and_saddles_up_to_the_border():
    for triangles in (False, True):
        sphere = curvature_tensors(make_shape("dome", radius=0.5, size=0.5, triangles=triangles))
        values = np.linalg.eigvalsh(sphere)
        np.testing.assert_allclose(values[:, 1:], 2.0, rtol=1e-6)
        np.testing.assert_allclose(values[:, 0], 0.0, atol=1e-9)
        tube = np.linalg.eigvalsh(curvature_tensors(sleeve(triangles=triangles)))
        np.testing.assert_allclose(tube[:, 2], 1 / RADIUS, rtol=0.01)
        np.testing.assert_allclose(tube[:, :2], 0.0, atol=0.01 / RADIUS)
    saddle = make_shape("saddle", size=0.2, curvature=2.0, resolution=33)
    middle = np.linalg.eigvalsh(curvature_tensors(saddle))[len(saddle.vertices) // 2]
    np.testing.assert_allclose(middle, [-2.0, 0.0, 2.0], atol=0.01)


def test_a_single_triangle_counts_as_flat():
    flat = curvature_tensors(make_surface([[0, 0, 0], [1, 0, 0], [0, 1, 0.2]], [[0, 1, 2]]))
    np.testing.assert_array_equal(flat, 0.0)


# --- what a run tells


def test_a_bodice_that_does_not_fit_says_where_and_which_cut_helps(tmp_path: Path):
    (tmp_path / "front.toml").write_text(
        'fabric = "denim"\ndatum = "centre"\nmodel = "membrane"\n[surface]\nshape = "bodice"\nresolution = 25\n'
        "[wear]\n[output]\nframes = 0\n"
    )
    result = run_scene(load_scene(tmp_path / "front.toml"), tmp_path / "out")
    wear = result.metrics["pieces"]["front"]["wear"]
    assert wear["held"] > 0.01
    assert wear["outside"] > 0.01
    assert "bust" in " ".join(wear["where_not"])
    best = wear["would_help"][0]
    assert best["outside_after"] < 0.7 * wear["outside"]
    assert all(wear[name]["min"] <= wear[name]["p05"] <= wear[name]["p50"] <= wear[name]["max"] for name in MAPS)
    lines = fit_lines(result.metrics)
    assert re.match(r"front: \d+\.\d % held beyond its limit, \d\.\d % in folds \(warp ", lines[0])
    verdict = result.metrics["verdict"]
    assert (verdict["fits"], verdict["by"]) == (False, "strain")
    assert verdict["findings"][0]["remedy"].startswith("would help: a ")
    assert any(line.startswith("  would help: a ") for line in lines)
    assert (tmp_path / "out" / "front.wear.png").stat().st_size > 10_000


def worn_entry(outside: float, area: float, cut: str) -> dict[str, object]:
    fits = outside <= 0.01
    strain = {"min": -0.02, "p05": -0.01, "p95": 0.08, "max": 0.203}
    return {
        "area_m2": area,
        "wear": {
            "outside": outside,
            "held": outside,
            "slack": 0.0,
            "strain_limit": 0.05,
            "shear_limit": 15.0,
            "strain_warp": strain,
            "strain_weft": strain,
            "shear": {"min": -12.0, "p05": -3.0, "p95": 4.0, "max": 9.0},
            "pressure": {"p05": 0.0, "p50": 30.0, "p95": 256.0, "max": 676.0},
            "where_not": [] if fits else ["stretched 8 % along weft"],
            "where_slack": [],
            "would_help": [] if fits else [{"cut": cut, "length_m": 0.1, "outside_after": 0.02}],
        },
    }


def test_a_garment_fits_if_all_of_its_pieces_do_and_says_which_do_not():
    pieces = {"front": worn_entry(0.12, 0.3, "a dart from the border"), "back": worn_entry(0.0, 0.1, "")}
    found = garment_wear(pieces)  # type: ignore[arg-type]
    assert found == {
        "outside": pytest.approx(0.09),
        "held": pytest.approx(0.09),
        "slack": 0.0,
        "where_not": ["front: stretched 8 % along weft"],
        "would_help": [
            {"piece": "front", "cut": "a dart from the border", "length_m": 0.1, "outside_after": 0.02},
        ],
    }
    metrics = {"pieces": pieces, "wear": found}
    verdict = judge(metrics)
    assert verdict is not None
    assert verdict.words == "does not fit by its strain"
    assert verdict.findings[0].words == "9.0 % of the cloth is held beyond its limit; front: stretched 8 % along weft"
    lines = fit_lines({**metrics, "verdict": verdict.as_dict()})
    assert lines[0] == (
        "front: 12.0 % held beyond its limit, 0.0 % in folds (warp -1.0 to +8.0 % [-2.0 to +20.3], weft -1.0 to +8.0 % [-2.0 to +20.3], "
        "shear -3.0 to +4.0 degrees [-12.0 to +9.0], limit 5 % and 15 degrees; pressure 0 to 256 Pa [up to 676], median 30)"
    )
    assert lines[-3] == "ranges: 5 to 95 % of the cloth [all of it], against the surface"
    assert "  would help: a dart from the border: 12.0 % -> 2.0 % beyond the limit" in lines
    assert lines[-2] == "does not fit by its strain"
    assert lines[-1].startswith(
        "  9.0 % of the cloth is held beyond its limit; front: stretched 8 % along weft; would help: "
    )
    assert garment_wear({"back": pieces["back"]})["held"] == 0.0  # type: ignore[dict-item]


def test_a_sheet_shows_all_pieces_at_one_scale_of_length_and_of_colour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The larger piece is twice as large on paper, and its colours mean the same."""
    from matplotlib.figure import Figure

    shapes = [sleeve(resolution=9), make_shape("cylinder", radius=0.03, height=0.15, angle=300.0, resolution=9)]
    fitting, tight = (warpflat.flatten(shape, fabric=NET, datum="centre", device=DEVICE) for shape in shapes)
    results = [fitting, replace(tight, positions=tight.positions * [0.7, 1.0])]
    drawn: list[Figure] = []
    monkeypatch.setattr("warpflat.pattern.export.figure.write_figure", lambda path, figure: drawn.append(figure))
    write_wear_sheet(tmp_path / "wear.png", results, title="sleeves")
    (figure,) = drawn
    (page,) = (axis for axis in figure.axes if not axis.axison)
    np.testing.assert_allclose((page.get_xlim()[1], page.get_ylim()[1]), figure.get_size_inches())
    maps = [artist for artist in page.artists if isinstance(artist, Pixels)]
    assert len(maps) == 2 * len(MAPS)
    assert sum(axis.axison for axis in figure.axes) == len(MAPS)
    # To within a pixel at either side of an image that is 3 pixels larger there.
    shown = np.array([each.pixels.shape[1::-1] for each in maps]) - 6
    sizes = np.array([np.ptp(result.positions, axis=0) for result in np.repeat(results, len(MAPS))])
    np.testing.assert_allclose(shown / sizes, shown[0, 1] / sizes[0, 1], rtol=0.02)
    # The scale of the pressure is told in millimetres of mercury, too.
    (bar,) = (axis for axis in figure.axes if axis.child_axes)
    (mercury,) = bar.child_axes
    figure.draw_without_rendering()
    assert mercury.get_xlabel() == "mmHg"
    np.testing.assert_allclose(mercury.get_xlim(), np.divide(bar.get_xlim(), 133.322), rtol=1e-9)
    told = " ".join(text.get_text() for text in page.texts)
    told = " ".join(told.split())
    assert "0.0 % held beyond its limit, 0.0 % in folds" in told
    slack = 100 * results[1].fit.slack
    assert slack > 50.0 or results[1].fit.held > 0.5
    # The most is told as well: a twentieth of the cloth lies beyond the upper end of the range.
    most = [result.measures["wear"] for result in results]
    assert "5 to 95 % of the cloth [all of it]" in told
    for wear in most:
        assert f"{100 * wear['strain_weft']['max']:+.1f}]" in told
        assert wear["pressure"]["max"] < 1 or f"[up to {wear['pressure']['max']:,.0f}]" in " ".join(told.split())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[wear]\nstretch_wrap = 0.1\n", r"wear.stretch_wrap: unknown key .*did you mean 'stretch_warp'"),
        ("[wear]\npressure = '9'\n", r"wear.pressure: should be a valid number, got '9'"),
    ],
)
def test_misspelled_wishes_in_a_scene(tmp_path: Path, text: str, message: str):
    (tmp_path / "a.toml").write_text(f"{text}[surface]\nshape = 'dome'\n")
    with pytest.raises(InputError, match=message):
        load_scene(tmp_path / "a.toml")


def test_a_pressure_on_a_ball_is_carried_both_ways():
    """p = 2 T / R: a gore of a ball is smaller by half of what a tube of its radius is, along both threads."""
    film, radius = replace(NET, stiffness_warp=5e3, stiffness_weft=5e3, curve_warp=(), curve_weft=()), 1.0
    surface = make_shape("dome", size=0.5, radius=radius, resolution=17)
    stretch, notes = intended_stretch(surface, film, surface.vertices[:, :2], Wear(pressure=200.0))
    assert stretch is not None
    np.testing.assert_allclose(np.median(stretch - 1.0, axis=0), 200.0 * radius / 2.0 / 5000.0, rtol=0.1)
    assert any("along warp and weft" in note for note in notes)


def test_a_stretch_beyond_the_limit_is_meant_and_told():
    wear = Wear(stretch_weft=NET.strain_limit + 0.1)
    result = warpflat.flatten(sleeve(), fabric=NET, datum="centre", wear=wear, device=DEVICE)
    assert result.fit.within_limits
    assert any("beyond power-net's limit" in note for note in result.notes)
    looser = warpflat.change_fabric(result, replace(NET, strain_limit=1.0))
    assert not any("beyond" in note for note in looser.notes)
    # So it is where a pressure sets the stretch of the other threads.
    surface, wear = sleeve(), Wear(stretch_warp=NET.strain_limit + 0.1, pressure=1000.0)
    _, notes = intended_stretch(surface, NET, surface.vertices[:, :2], wear)
    assert any("beyond power-net's limit" in note for note in notes)


def test_a_place_is_told_alike_on_the_mirror_image():
    """Whatever corner of its face comes first in the mesh."""
    bodice = warpflat.make_shape("bodice", resolution=17)
    swapped = {"left": "right", "right": "left"}
    image = with_lines(
        make_surface(bodice.vertices * [-1.0, 1.0, 1.0], bodice.faces[:, ::-1], weld=False),
        {swapped.get(name, name): line for name, line in bodice.lines.items()},
    )
    words = [
        [misfit.words for misfit in warpflat.flatten(surface, fabric="woven", datum="centre").fit.misfits]
        for surface in (bodice, image)
    ]
    turned = [re.sub("left|right", lambda side: swapped[side[0]], told) for told in words[1]]
    assert words[0]
    assert sorted(words[0]) == sorted(turned)
