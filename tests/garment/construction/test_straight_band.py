"""Bands of even width: found, cut straight, sewn stretched."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from obj_files import write_obj

import warpflat
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.constraints import FixedLength
from warpflat.garment.construction.sew_pieces import sew_pieces
from warpflat.garment.construction.straight_band import find_band


def _strip(
    name: str, low: tuple[float, float], high: tuple[float, float], part=(0.0, 1.0), rows: int = 2, wave: float = 0.0
) -> Surface:
    """Return a strip around a cone between two rings of (radius, height) [m], over a part of the turn; its upper edge may wave."""
    columns = 1 + round(60 * (part[1] - part[0]))
    turn = 2.0 * np.pi * np.linspace(*part, columns)
    up = np.linspace(0.0, 1.0, rows + 1)[:, None] * (1.0 + wave * np.sin(4.0 * turn))
    radius, height = (a + up * (b - a) for a, b in zip(low, high, strict=True))
    places = np.stack([radius * np.sin(turn), height, radius * np.cos(turn)], axis=-1).reshape(-1, 3)
    corner = (columns * np.arange(rows)[:, None] + np.arange(columns - 1)).ravel()
    faces = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    return warpflat.make_surface(places, faces, name=name)


# A neck band of 18 mm, 20 turned by a cone of 45 degrees, on the yoke below it.
NECK, BELOW, TOP = (0.09, 1.40), (0.16, 1.35), (0.077, 1.413)


def _sew(*surfaces: Surface, **options):
    return sew_pieces([warpflat.flatten(surface) for surface in surfaces], eased=True, **options)


@pytest.fixture(scope="module")
def yoke() -> Surface:
    return _strip("yoke", BELOW, NECK, rows=4)


def test_a_neck_band_is_cut_straight_and_stretched_to_the_neck(yoke):
    band = _strip("band", NECK, TOP)
    garment = _sew(yoke, band, bands="auto")
    made = garment.pieces["band"]
    found = find_band(warpflat.flatten(band))
    assert found is not None
    sides = [made.positions[side] for side in found.sides]
    for side in sides:
        # Straight: nowhere off the line between its ends.
        assert np.ptp(side @ np.array([1.0, 0.0])) < 1e-9
        assert polyline_length(side) == pytest.approx(min(found.lengths), rel=1e-9)
    shorter = min(polyline_length(band.vertices[side]) for side in found.sides)
    assert min(found.lengths) == pytest.approx(shorter)
    assert made.flipped_faces == 0
    assert made.stages[-1].name == "straight"
    # The neck keeps its length, and the seam is told with what it is stretched by.
    (seam,) = [seam for seam in garment.seams if set(seam.sides) == {"yoke", "band"}]
    neck, cut = sorted(seam.lengths, reverse=True)
    assert neck == pytest.approx(0.09 * 120 * np.sin(np.pi / 60), rel=2e-3)
    assert cut == pytest.approx(shorter, rel=1e-9)
    assert abs(seam.difference) < 1e-6
    assert abs(seam.ease) == pytest.approx(abs(seam.lengths[1] / seam.lengths[0] - 1.0), abs=1e-6)
    assert any("cut straight, 484 x 18 mm" in note for note in garment.notes)
    assert garment.sewn is not None
    assert set(garment.sewn.pieces) == {"yoke", "band"}


def test_a_band_is_cut_shorter_on_request(yoke):
    made = [_sew(yoke, _strip("band", NECK, TOP), bands="auto", shorter=share).pieces["band"] for share in (0.0, 0.15)]
    lengths = [np.ptp(piece.positions, axis=0) for piece in made]
    assert lengths[1].max() == pytest.approx(0.85 * lengths[0].max(), rel=1e-9)
    assert lengths[1].min() == pytest.approx(lengths[0].min(), rel=1e-9)


@pytest.mark.parametrize(
    ("band", "auto", "straight"),
    [
        # A ring of a waistband in two halves is shaped, unless somebody wants it straight.
        ([("a", (0.0, 0.5)), ("b", (0.5, 1.0))], 0, 2),
        ([("a", (0.0, 1.0))], 1, 1),
    ],
)
def test_by_itself_only_a_ring_of_one_strip_is_straight(yoke, band, auto, straight):
    strips = [_strip(name, NECK, TOP, part=part) for name, part in band]
    for how, count in (("auto", auto), ("straight", straight), ("as worn", 0)):
        garment = _sew(yoke, *strips, bands=how)
        assert sum(piece.stages[-1].name == "straight" for piece in garment.pieces.values()) == count, how


@pytest.mark.parametrize(
    "surface",
    [
        _strip("wide", NECK, (0.03, 1.49)),
        _strip("uneven", NECK, TOP, wave=0.5),
        _strip("short", NECK, TOP, part=(0.0, 0.15)),
        # No cloth stretches from 484 to 1,000 mm.
        _strip("yoke", BELOW, NECK),
    ],
    ids=lambda surface: surface.name,
)
def test_what_is_no_band_stays_as_worn(surface):
    assert find_band(warpflat.flatten(surface)) is None


def test_a_band_that_a_constraint_holds_stays_as_worn(yoke):
    band = _strip("band", NECK, TOP)
    held = FixedLength(piece="band", line="edge", length=0.5)
    band.lines["edge"] = np.arange(122, 183, dtype=np.int32)
    garment = sew_pieces([warpflat.flatten(one) for one in (yoke, band)], [held], bands="auto")
    assert garment.pieces["band"].stages[-1].name != "straight"


def test_a_band_both_of_whose_edges_are_sewn_stays_as_worn(yoke):
    collar = _strip("collar", TOP, (0.05, 1.45), rows=3)
    garment = _sew(yoke, _strip("band", NECK, TOP), collar, bands="auto")
    assert garment.pieces["band"].stages[-1].name != "straight"


def test_the_command_cuts_a_neck_band_straight(command, yoke):
    write_obj(Path("neck.obj"), yoke, _strip("band", NECK, TOP), names=(yoke.name, "band"), digits=".9f")
    plain = [
        "flatten",
        "neck.obj",
        "--units",
        "m",
        "--component",
        "all",
        "--fabric",
        "jersey",
        "--frames",
        "0",
        "--no-picture",
    ]
    for options, straight in (([], True), (["--bands", "as worn"], False)):
        assert command(*plain, *options, "--out", "made").code == 0
        metrics = json.loads(Path("made/metrics.json").read_text(encoding="utf-8"))
        assert any("cut straight" in note for note in metrics["pieces"]["band"]["notes"]) == straight
        eases = [abs(seam["ease"]) for seam in metrics["seams"] if "band" in seam["name"] and "yoke" in seam["name"]]
        assert eases == pytest.approx([0.144 if straight else 0.0], abs=0.03)
    assert "--bands: should be 'auto', 'straight' or 'as worn'" in command(*plain, "--bands", "straigth").refusal
