"""Size tables, measurements, and the bodies that are built to them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from bodies import body_of_size
from self_intersections import self_intersections

from warpflat.core.errors import InputError
from warpflat.core.vectors import unit
from warpflat.flat.surface.normals import area_vectors
from warpflat.garment.mannequin.layout import make_layout
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.measurements import (
    measurements_from_size,
    measurements_from_values,
    size_names,
    size_tables,
)
from warpflat.garment.mannequin.profiles import convex_girth, scale_to_girth, superellipse_exponent

SIZES = [name for name in size_names() if not name.startswith("UK")]
GIRTHS = ("bust", "underbust", "waist", "abdomen", "hip", "thigh", "knee", "ankle", "neck")
body_of = partial(body_of_size, 40.0)


def _area(body: Mannequin) -> float:
    corner = body.vertices[body.layout.faces]
    return 0.5 * float(np.linalg.norm(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), axis=1).sum())


@pytest.mark.parametrize("size", SIZES)
def test_tape_reads_what_the_table_says(size: str) -> None:
    wished, levels = measurements_from_size(size), body_of(size).levels()
    for name in GIRTHS:
        assert abs(levels[name].girth - wished.lengths[name]) < 0.001, name
    for name, level in (("shoulder", "shoulder left"), ("chest_width", "chest front"), ("back_width", "chest back")):
        assert abs(levels[level].girth - wished.lengths[name]) < 0.001, name
    for name in ("bust", "waist", "hip", "knee"):
        assert levels[name].height == pytest.approx(wished.heights[name], abs=1e-9)
    layout = body_of(size).layout
    nape = body_of(size).vertices[layout.back[-1, layout.to_arm]]
    under = body_of(size).line("side left")[-1]
    assert nape[1] - under[1] == pytest.approx(wished.heights["nape"] - wished.heights["underarm"], abs=0.001)


@pytest.mark.parametrize("size", SIZES)
def test_surface_is_sound(size: str) -> None:
    body = body_of(size)
    assert np.isfinite(body.vertices).all()
    assert len(self_intersections(body.vertices, body.layout.body_faces)) == 0
    # No quad is folded over its diagonal, so no normal turns against its neighbours'.
    q = body.vertices[body.layout.faces]
    first = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    second = np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 0])
    assert (np.einsum("ij,ij->i", first, second) > 0).all()
    rings = body.layout.rings[: body.layout.level_row["bust"] + 1]
    trunk = np.isin(body.layout.faces, rings).all(axis=1)
    middle = q.mean(axis=1)
    away = middle * [1.0, 0.0, 1.0] - [0.0, 0.0, float(middle[trunk, 2].mean())]
    assert (np.einsum("ij,ij->i", unit(area_vectors(body.vertices, body.layout.faces)), away)[trunk] > 0).all()


def test_left_and_right_are_mirror_images() -> None:
    body = body_of("EU 38")
    other = body.vertices[body.layout.mirror] * [-1.0, 1.0, 1.0]
    assert np.abs(other - body.vertices).max() < 1e-5


@pytest.mark.parametrize("table", list(size_tables()["tables"]))
def test_area_and_girth_grow_with_size(table: str) -> None:
    own = size_tables()["tables"][table]
    row = [body_of(f"{own['label']} {size}") for size in own["sizes"]]
    areas = [_area(body) for body in row]
    assert np.all(np.diff(areas) > 0.005)
    for level in ("bust", "waist", "hip", "neck", "armhole left"):
        assert np.all(np.diff([body.levels()[level].girth for body in row]) > 0.0), level


def test_sizes_correspond_vertex_by_vertex() -> None:
    small, large = body_of("EU 36"), body_of("men 56")
    assert np.array_equal(small.layout.faces, large.layout.faces)
    assert list(small.layout.bricks) == list(large.layout.bricks)
    # A graded nest: halfway between two sizes lies a body, not a tangle.
    q = (0.5 * (small.vertices + large.vertices))[small.layout.faces]
    assert (np.linalg.norm(np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1]), axis=1) > 0).all()


def test_dress_form_not_vase() -> None:
    body = body_of("EU 38")
    front, back = body.line("centre front"), body.line("centre back")
    princess = body.line("princess front left")
    row = body.layout.level_row
    # Bust points stand ahead of the breastbone and of the ribs below; the seat behind the small of the back.
    assert princess[row["bust"], 2] > front[row["bust"], 2] + 0.004
    assert princess[row["bust"], 2] > princess[row["underbust"], 2] + 0.02
    assert back[row["waist"], 2] > back[row["hip"], 2] + 0.02
    # The blades stand out behind the small of the back, on the centre line and more so beside it.
    blade = body.line("princess back left")
    assert back[row["waist"], 2] > back[row["chest"], 2] + 0.005
    assert blade[row["waist"], 2] > blade[row["chest"], 2] + 0.005
    # Depth and width of the waist are a body's, not a pipe's.
    waist = body.line("waist")
    assert 0.70 < np.ptp(waist[:, 2]) / np.ptp(waist[:, 0]) < 0.90


@pytest.mark.parametrize("edge", [8.0, 15.0])
def test_resolution_keeps_the_body(edge: float) -> None:
    fine = Mannequin.from_size("EU 38", resolution_mm=edge)
    for level in ("bust", "waist", "hip", "neck"):
        assert fine.levels()[level].girth == pytest.approx(body_of("EU 38").levels()[level].girth, abs=1e-6)
    assert _area(fine) == pytest.approx(_area(body_of("EU 38")), rel=0.01)
    edges = np.linalg.norm(np.diff(fine.line("waist"), axis=0), axis=1)
    assert edges.mean() == pytest.approx(edge / 1000.0, rel=0.35)


def test_aliases_and_statures() -> None:
    assert measurements_from_size("UK 10").lengths == measurements_from_size("eu38").lengths
    assert measurements_from_size("UK 32").lengths["bust"] == 1.46
    assert measurements_from_size("EU 40 petite").lengths == measurements_from_size("EU 40/158").lengths
    assert measurements_from_size("EU 40 tall").lengths["stature"] == 1.74
    tall = measurements_from_size("men 50/188")
    assert tall.lengths["hip"] == pytest.approx(0.964 + 2 * 0.012)
    assert tall.heights["nape"] == pytest.approx(1.522 + 2 * 0.054)


def test_plus_sizes_are_those_of_another_table() -> None:
    """The German DOB table (survey of 1994; Hofenbitzer, Grundschnitte und Modellentwicklungen 1, p. 20), whose steps begin with EU 54."""
    dob = {  # size: bust, waist, hip, upper arm, wrist [cm]
        38: (88, 72, 97, 28.0, 15.8), 42: (96, 80, 103, 30.4, 16.6), 46: (104, 88, 109, 32.8, 17.4), 48: (110, 94.5, 114, 34.6, 18.0),
        50: (116, 101, 119, 36.4, 18.6), 52: (122, 107.5, 124, 38.2, 19.2), 54: (128, 114, 129, 40.0, 19.8),
        56: (134, 120.5, 134, 41.8, 20.4), 58: (140, 127, 139, 43.6, 21.0), 60: (146, 133.5, 144, 45.4, 21.6),
    }  # fmt: skip
    for size, (bust, waist, hip, upper_arm, wrist) in dob.items():
        ours = measurements_from_size(f"EU {size}").lengths
        assert 100.0 * ours["bust"] == pytest.approx(bust), size
        assert 100.0 * ours["waist"] == pytest.approx(waist, abs=1.51), size
        assert 100.0 * ours["hip"] == pytest.approx(hip, abs=3.01), size
        assert 100.0 * ours["upper_arm"] == pytest.approx(upper_arm, abs=1.1), size
        assert 100.0 * ours["wrist"] == pytest.approx(wrist, abs=1.7), size


def test_missing_measurements_are_completed_and_said() -> None:
    made = measurements_from_values(bust=0.88, waist=0.70)
    assert made.lengths["waist"] == 0.70
    assert made.lengths["hip"] == pytest.approx(0.96)
    assert any(note.startswith("hip = 96.0 cm") for note in made.notes)
    assert not any(note.startswith("waist") for note in made.notes)
    body = Mannequin.from_measurements(bust=0.88, waist=0.70, resolution_mm=25)
    assert body.levels()["waist"].girth == pytest.approx(0.70, abs=1e-6)
    assert body.notes == made.notes


def test_centimetres_and_millimetres_are_read_as_they_must_be_meant() -> None:
    made = measurements_from_values(bust=104, waist=880.0, hip=1.12)
    assert [made.lengths[name] for name in ("bust", "waist", "hip")] == pytest.approx([1.04, 0.88, 1.12])
    assert made.notes[:2] == (
        "bust = 104 is read as cm: in metres it is 1.04", "waist = 880 is read as mm: in metres it is 0.88"
    )  # fmt: skip
    assert measurements_from_size("EU 38", waist=74).lengths["waist"] == pytest.approx(0.74)
    # No length in one unit could be meant in another.
    for low, high in size_tables()["valid"]["range"].values():
        assert high < 10.0 * low


def test_a_child_is_no_small_woman() -> None:
    typed = measurements_from_values(bust=0.64, waist=0.58, hip=0.68, stature=1.28)
    assert typed.body == "children"
    assert any(note.startswith("completed as a child's") for note in typed.notes)
    assert measurements_from_values(table="women", bust=0.64, stature=1.28).body == "women"
    assert measurements_from_values(bust=0.84, stature=1.50).body == "women"
    # Heads grow less than bodies.
    heads = [measurements_from_size(f"EU {size}").lengths["head"] for size in (92, 128, 164)]
    assert heads == pytest.approx([0.498, 0.525, 0.552])
    with pytest.raises(InputError, match="leave out 'tall'"):
        measurements_from_size("EU 104 tall")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"waist": 3.0}, r"waist = 3 m: valid range 0\.45 to 1\.8 m"),
        ({"bust": -0.88}, r"bust = -0\.88 m: valid range"),
        ({"bust": float("nan")}, "valid range"),
        ({"bust": 0.60, "waist": 1.30}, r"bust = 0\.6 m does not go with waist = 1\.3 m: valid range 0\.9"),
        ({"bust": 0.88, "hip": 1.80}, r"hip = 1\.8 m does not go with"),
        ({"neck": 0.37}, "at least one of bust, waist, hip"),
        ({"bust": 0.88, "wasit": 0.7}, "did you mean 'waist'"),
        ({"bust": True}, "a number of metres"),
        ({"bust": 0.88, "height": 1.66}, "'height' is unknown: did you mean 'stature'"),
        ({"bust": 41}, r"valid range 0\.5 to 1\.8 m; 41 inches are 1\.04 m"),
    ],
)
def test_nonsense_is_refused_with_the_valid_range(given: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        measurements_from_values(**given)
    assert "\n" not in str(caught.value)


def test_unknown_size_and_stature() -> None:
    with pytest.raises(InputError, match="did you mean 'EU 38'"):
        Mannequin.from_size("EU 39")
    with pytest.raises(InputError, match="stature after '/'"):
        Mannequin.from_size("men 50/tall")
    with pytest.raises(InputError, match="2 to 40 mm"):
        make_layout(100.0)


def test_odd_but_valid_bodies_are_built() -> None:
    for given in (
        {"bust": 1.30, "waist": 1.25, "hip": 1.35},
        {"bust": 0.74, "waist": 0.56, "hip": 0.80, "stature": 1.5},
    ):
        body = Mannequin.from_measurements(resolution_mm=20, **given)
        for name, value in given.items():
            if name != "stature":
                assert body.levels()[name].girth == pytest.approx(value, abs=1e-6)
        assert len(self_intersections(body.vertices, body.layout.body_faces)) == 0


@pytest.mark.parametrize(
    "given",
    [
        {"bust": 0.84, "waist": 0.82, "hip": 0.92},
        {"bust": 0.80, "waist": 0.90, "hip": 0.90},
        {"bust": 1.20, "waist": 0.95, "hip": 0.95},
        {"bust": 1.60, "waist": 1.50, "hip": 1.65},
        {"waist": 0.90},
        {"table": "men", "bust": 0.90, "waist": 1.10},
    ],
)
def test_what_is_completed_lies_between_what_is_given(given: dict[str, float]) -> None:
    lengths = measurements_from_values(**given).lengths
    for name, ends in (("abdomen", ("waist", "hip")), ("underbust", ("waist", "bust"))):
        low, high = sorted(lengths[end] for end in ends)
        assert low <= lengths[name] <= high, name
    body = Mannequin.from_measurements(resolution_mm=20, **given)
    assert len(self_intersections(body.vertices, body.layout.body_faces)) == 0


def test_completion_agrees_with_the_table() -> None:
    of_size = measurements_from_size("EU 42").lengths
    made = measurements_from_values(bust=0.96, waist=0.80, hip=1.04).lengths
    assert set(made) == set(of_size)
    assert all(made[name] == pytest.approx(of_size[name], abs=2e-5) for name in made)


@pytest.mark.parametrize("stature", [1.58, 1.66])
def test_what_a_size_lacks_is_completed_as_for_a_typed_body(stature: float) -> None:
    of_size = measurements_from_size(f"JIS 5AR/{100 * stature:g}")
    made = measurements_from_values(bust=0.77, hip=0.87, stature=stature)
    assert of_size.lengths == pytest.approx(made.lengths)
    assert of_size.heights == pytest.approx(made.heights)


def test_lengths_down_the_body_go_with_stature() -> None:
    tall, usual = (measurements_from_values(bust=0.84, **at) for at in ({"stature": 1.85}, {}))
    for name in ("nape_to_waist", "armscye_depth"):
        assert tall.lengths[name] == pytest.approx(usual.lengths[name] * 1.85 / 1.66)
    assert tall.heights["waist"] / 1.85 == pytest.approx(usual.heights["waist"] / 1.66)
    assert tall.lengths["neck"] == usual.lengths["neck"]
    assert measurements_from_size("EU 36/185").heights == tall.heights
    given = measurements_from_values(bust=0.84, stature=1.85, nape_to_waist=0.43)
    assert given.lengths["nape_to_waist"] == 0.43
    # A child's bones are those of its stature, its girths those of its size.
    child, own, taller = (measurements_from_size(size) for size in ("EU 104/110", "EU 104", "EU 110"))
    for name in ("shoulder", "nape_to_waist", "arm_length", "inside_leg"):
        assert child.lengths[name] == pytest.approx(taller.lengths[name])
    assert child.lengths["bust"] == own.lengths["bust"]
    assert measurements_from_size("EU 104", stature=1.1, inside_leg=0.45).lengths["inside_leg"] == 0.45
    # Men's tables say what changes with stature, for what is completed too.
    men = measurements_from_values(table="men", bust=1.0, stature=1.88)
    assert men.lengths == pytest.approx(measurements_from_size("men 50/188").lengths)
    assert men.heights == measurements_from_size("men 50/188").heights


@pytest.mark.parametrize(
    "given",
    [
        {"bust": 1.40, "stature": 1.50},
        {"bust": 0.90, "stature": 1.30},
        {"bust": 0.90, "nape_to_waist": 0.54},
        {"bust": 0.90, "armscye_depth": 0.30},
        {"hip": 1.00, "neck": 0.56},
        {"hip": 0.62},
    ],
)
def test_nothing_is_refused_for_what_was_not_given(given: dict[str, float]) -> None:
    body = Mannequin.from_measurements(resolution_mm=25, **given)
    assert len(self_intersections(body.vertices, body.layout.body_faces)) == 0
    made = measurements_from_values(**given)
    assert all(made.lengths[name] == value for name, value in given.items())
    if "armscye_depth" in given:
        assert made.lengths["nape_to_waist"] == pytest.approx(0.30 / 0.62)
        assert any("as far as armscye_depth lets it" in note for note in made.notes)


def test_measurements_replace_those_of_a_size() -> None:
    plain, made = measurements_from_size("EU 38"), measurements_from_size("EU 38", waist=0.76)
    assert made.lengths["waist"] == 0.76
    assert made.lengths["abdomen"] == pytest.approx(0.82 + (1 - 0.4167) * 0.04, abs=2e-5)
    assert made.lengths["underbust"] == 0.76  # not less than the waist
    assert all(made.lengths[n] == plain.lengths[n] for n in plain.lengths if n not in ("waist", "abdomen", "underbust"))
    assert "size EU 38 with waist = 76 cm" in made.source
    assert "waist = 76.0 cm instead of the 72.0 cm of size EU 38" in made.notes
    assert measurements_from_size("EU 38", bust=0.92).lengths["underbust"] == pytest.approx(0.852 * 0.92)
    assert measurements_from_size("EU 38", bust=0.92).lengths["abdomen"] == 0.82
    assert measurements_from_size("men 50", stature=1.88).lengths == measurements_from_size("men 50/188").lengths
    body = Mannequin.from_size("EU 38", resolution_mm=25, waist=0.76)
    assert body.levels()["waist"].girth == pytest.approx(0.76, abs=1e-6)
    assert body.notes == made.notes


@pytest.mark.parametrize(
    ("size", "given", "words"),
    [
        (38, {}, r'size is of type int; it must be text, such as "EU 38"'),
        ("EU 38", {"wasit": 0.7}, "did you mean 'waist'"),
        ("EU 38", {"waist": 3.0}, "valid range"),
        (
            "EU 38",
            {"waist": 1.3},
            r"waist = 1\.3 m does not go with bust = 0\.88 m of size EU 38: valid range 0\.46 to 1\.17 m",
        ),
        ("EU 38", {"chest_width": 0.25, "bust_points": 0.26}, "too little for so deep a bust"),
        ("men 50/182", {"stature": 1.8}, "give the stature once"),
    ],
)
def test_a_size_with_impossible_measurements_is_refused(size: object, given: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Mannequin.from_size(size, **given)  # type: ignore[arg-type]


def test_tape_bridges_hollows() -> None:
    star = np.array([[1.0, 0.0], [0.1, 0.1], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    assert convex_girth(star) == pytest.approx(4 * np.sqrt(2.0))
    row = np.column_stack([star[:, 0], np.full(5, 0.3), star[:, 1]])
    assert convex_girth(scale_to_girth(row, 0.5)) == pytest.approx(0.5)
    with pytest.raises(InputError, match="one line"):
        convex_girth(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))


def test_superellipse_fills_its_box() -> None:
    assert superellipse_exponent(np.pi / 4) == pytest.approx(2.0)
    with pytest.raises(InputError, match=r"0\.6 to 0\.97"):
        superellipse_exponent(0.99)
