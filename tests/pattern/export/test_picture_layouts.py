"""Pictures of pieces of every number, size, shape, name and map are drawn, and all their words are on the page.

Examples are few here. `WARPFLAT_LAYOUTS=5000` tries so many of each kind.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from export_meshes import grid, surface
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.fabric.limits import Amount, Demand
from warpflat.flat.model.fit import MAPS as MAPS_OF_FIT
from warpflat.flat.model.fit import Misfit, WornFit
from warpflat.garment.draping.correct_pattern import Correction
from warpflat.garment.draping.picture import write_compared_drapes, write_correction_picture, write_drape_picture
from warpflat.pattern.drafting.drafted import SeamReport
from warpflat.pattern.drafting.walked import WalkedSeam
from warpflat.pattern.export.dressed import Body
from warpflat.pattern.export.figure import DPI, PAGE_WIDTH, keep_words_on_page, new_figure
from warpflat.pattern.export.fit_picture import write_wear_sheet
from warpflat.pattern.export.geometry import face_areas
from warpflat.pattern.export.ledger_picture import write_ledger_picture
from warpflat.pattern.export.letters import all_letters
from warpflat.pattern.export.picture import PicturePiece, draw_figure
from warpflat.pattern.export.walked_picture import write_walked_picture

EXAMPLES = int(os.environ.get("WARPFLAT_LAYOUTS", "0"))
LONGEST_SIDE, PIXELS = 60_000, 150_000_000


def examples(few: int, share: float = 1.0) -> Any:
    return settings(
        max_examples=max(few, round(share * EXAMPLES)),
        derandomize=not EXAMPLES,
        database=None,
        deadline=None,
        phases=[Phase.generate],  # an example found is small enough; making it smaller takes minutes
        suppress_health_check=list(HealthCheck),
    )


NAMES = st.one_of(
    st.sampled_from(
        ["W" * 80, "衣" * 80, "$x^{$", r"$\frac$ {", "left _front_ %s", "\u202eabc", "👗 dress", "I" * 80, "-"]
    ),
    st.text(st.characters(exclude_categories=["Cc", "Cs"]), min_size=1, max_size=80),
)
MAPS = st.sampled_from(["zero", "one value", "tiny", "huge", "peak", "slope", "wild"])


def values(kind: str, count: int, size: float, seed: int) -> np.ndarray:
    """A map of so many faces without a number that is none."""
    rng = np.random.default_rng(seed)
    found = {
        "zero": np.zeros(count),
        "one value": np.full(count, size),
        "tiny": 1e-12 * rng.random(count),
        "huge": 1e9 * rng.random(count),
        "peak": np.where(np.arange(count) == count // 2, size, 0.0),
        "slope": np.linspace(0.0, size, count),
        "wild": 10.0 ** rng.uniform(-12.0, 6.0, count),
    }
    return found[kind]


@st.composite
def shapes(draw: st.DrawFn) -> tuple[str, np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Name, vertices in space [m], pattern [m], faces and lines of a piece that is flat, bent, or rolled up."""
    length = 10.0 ** draw(st.floats(np.log10(0.005), np.log10(9.0)))
    width = length / 10.0 ** draw(st.floats(0.0, 2.0))
    n, m = draw(st.integers(2, 5)), draw(st.integers(2, 9))
    index, faces = grid(n, m)
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, width, n), np.linspace(0.0, length, m)))
    angle = np.radians(draw(st.sampled_from([0.0, 90.0, 45.0, 7.0, 180.0])))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    pattern = np.column_stack([x, y]) @ turn.T
    bent = draw(st.sampled_from(["flat", "bowed", "rolled", "lying"]))
    if bent == "rolled":
        radius = length / (1.9 * np.pi)
        space = np.column_stack([x, radius * np.cos(y / radius), radius * np.sin(y / radius)])
    elif bent == "lying":
        space = np.column_stack([pattern[:, 0], np.zeros(len(x)), pattern[:, 1]])
    else:
        space = np.column_stack([pattern, 0.3 * width * np.sin(np.pi * x / width) * (bent == "bowed")])
    names = draw(st.lists(NAMES, max_size=4, unique=True))
    lines = [index[:, n // 2], index[m // 2], index[0], index[:, 0]]
    return draw(NAMES), space, pattern, faces, dict(zip(names, lines, strict=False))


@st.composite
def pieces(draw: st.DrawFn) -> PicturePiece:
    name, space, pattern, faces, lines = draw(shapes())
    density = values(draw(MAPS), len(faces), 10.0 ** draw(st.floats(-9.0, 6.0)), draw(st.integers(0, 99)))
    shape = surface(space, faces, name, **lines)
    given_lines = dict(lines)
    return PicturePiece(
        name=name,
        surface=shape,
        faces=faces,
        positions=pattern,
        face_energy_density=density,
        lines=given_lines,
        surface_lines=given_lines,
        datum=draw(st.sampled_from([None, *lines])),
        grain_angle=draw(st.sampled_from([0.0, 45.0, 90.0])),
        captions={"fabric": draw(NAMES), "strain energy": "12.3 mJ", "length error": "0.53 %", "converged": "NO"},
    )


def faults_of_page(figure: Any) -> list[str]:
    """Draw a page; what is wrong with it: a size that viewers do not open, or words beside the page."""
    canvas = figure.canvas
    with all_letters():
        keep_words_on_page(figure)
        canvas.draw()
    height, width = np.asarray(canvas.buffer_rgba()).shape[:2]
    sound = 300 < width <= LONGEST_SIDE and 100 < height <= LONGEST_SIDE and width * height <= PIXELS
    faults = [] if sound else [f"{width} by {height} pixels"]
    renderer = canvas.get_renderer()
    for text in [text for axes in figure.axes for text in axes.texts] + figure.texts:
        if text.get_text() and text.get_visible():
            box = text.get_window_extent(renderer)
            if max(-box.x0, box.x1 - width, -box.y0, box.y1 - height) >= 2:
                faults.append(f"{text.get_text()} at {box} on {width} by {height}")
    return faults


@examples(6)
@given(
    drawn=st.lists(pieces(), min_size=1, max_size=3) | st.lists(pieces(), min_size=1, max_size=30),
    scale=st.sampled_from([None, None, 1.0]),
    on_body=st.booleans(),
)
def test_picture_of_any_pieces(drawn: list[PicturePiece], scale: float | None, on_body: bool) -> None:
    body = None
    if on_body:
        _, faces = grid(9, 9)
        rows, around = np.divmod(np.arange(81), 9)
        turn = 2.0 * np.pi * around / 8.0
        body = Body(vertices=np.column_stack([0.2 * np.cos(turn), 0.2 * rows, 0.2 * np.sin(turn)]), faces=faces)
    figure = draw_figure(drawn, scale=scale, body=body)
    wide, tall = figure.get_size_inches()
    assert 8.0 <= wide <= PAGE_WIDTH + 1.0
    assert tall * DPI <= LONGEST_SIDE
    assert faults_of_page(figure) == []


def test_picture_of_lines_whose_names_have_no_ink() -> None:
    index, faces = grid(5, 5)
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 0.1, 5), np.linspace(0.0, 0.1, 5)))
    pattern, lines = np.column_stack([x, y]), {"\u00ad": index[:, 2], "\u2060": index[2], " ": index[0]}
    shape = surface(np.column_stack([x, y, 0.0 * x]), faces, "\u200b", **lines)
    piece = PicturePiece(
        name="\u200b", surface=shape, faces=faces, positions=pattern, face_energy_density=np.zeros(len(faces)),
        lines=lines, surface_lines=lines, datum=None, grain_angle=0.0, captions={"fabric": "\u00ad"},
    )  # fmt: skip
    assert faults_of_page(draw_figure([piece])) == []


def test_words_stay_on_a_page_whose_axes_take_the_scale_of_their_outlines() -> None:
    figure = new_figure(8.0, 6.0, dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.plot([0.0, 0.1], [0.0, 9.0])
    axes.text(0.0, 4.0, "W" * 60)
    axes.set_aspect("equal")
    assert faults_of_page(figure) == []


def faults_written(write: Any, *arguments: Any, **options: Any) -> list[str]:
    """What is wrong with the page that a function draws for a file; that there is none, too."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        pages: list[list[str]] = []
        patch.setattr(
            "warpflat.pattern.export.figure.write_figure", lambda path, figure: pages.append(faults_of_page(figure))
        )
        write(Path(folder) / "a.png", *arguments, **options)
    return [fault for faults in pages for fault in faults] if pages else ["no page"]


@st.composite
def worn(draw: st.DrawFn) -> Any:
    """What the pictures of a fit take of a flattened piece."""
    name, space, pattern, faces, lines = draw(shapes())
    count, shape = len(faces), surface(space, faces, name, **lines)
    maps = {key: values(draw(MAPS), count, draw(st.sampled_from([0.01, 1.0, -0.2])), 3) for key in MAPS_OF_FIT}
    area = np.full(count, face_areas(space, faces).mean() + 1e-12)
    misfits = ()
    if draw(st.booleans()):
        misfits = (
            Misfit(
                surface=shape,
                faces=np.arange(count // 2 + 1),
                area=1e-3,
                worst=Amount(way="warp", value=0.3, limit=0.1),
                vertex=0,
            ),
        )
    demand = Demand.of(find_fabric("woven"), *(maps[key] for key in ("strain_warp", "strain_weft", "shear")))
    fit = WornFit(**maps, area=area, demand=demand, misfits=misfits)
    return SimpleNamespace(
        surface=shape,
        network=SimpleNamespace(surface=shape),
        positions=pattern,
        faces=faces,
        fit=fit,
        fabric=SimpleNamespace(name=draw(NAMES)),
        grain_angle=draw(st.sampled_from([0.0, 45.0])),
        unsewn=None,
        remedies=(),
    )


@examples(3, 0.2)
@given(st.lists(worn(), min_size=1, max_size=30), NAMES, st.booleans())
def test_fit_of_any_pieces(pieces: list[Any], title: str, on_form: bool) -> None:
    on_body = [
        {key: np.where(np.arange(len(piece.faces)) % 2 == 0, 0.1, np.nan) for key in ("body_strain", "body_pressure")}
        for piece in pieces
    ]
    assert faults_written(write_wear_sheet, pieces, title=title, on_body=on_body if on_form else []) == []


@st.composite
def seams(draw: st.DrawFn) -> WalkedSeam:
    length = 10.0 ** draw(st.floats(np.log10(0.005), np.log10(9.0)))
    along = np.linspace(0.0, length, 21)
    bow = length / 10.0 ** draw(st.floats(0.0, 2.0)) * draw(st.sampled_from([0.0, 1.0, -1.0]))
    first = np.column_stack([along, bow * np.sin(np.pi * along / length)])
    if draw(st.booleans()):  # a ring: its ends meet
        turn = 2 * np.pi * along / length
        first = length * np.column_stack([np.cos(turn), np.sin(turn)])
    notches = first[: draw(st.integers(0, 4))]
    report = SeamReport(
        name=draw(NAMES),
        size=draw(st.sampled_from(["", "EU 38", "made to measure"])),
        sides=("a", "b"),
        length_mm=(1e3 * length, 1e3 * length),
        ease=draw(st.sampled_from([0.0, 0.05])),
        difference_mm=-0.1,
        notches_mm=draw(st.sampled_from([None, 0.2])),
    )
    return WalkedSeam(report=report, line=first, notches=(notches, notches))


@examples(4, 0.2)
@given(st.lists(seams(), min_size=1, max_size=60), NAMES)
def test_walk_of_any_seams(walked: list[WalkedSeam], title: str) -> None:
    assert faults_written(write_walked_picture, walked, title=title) == []


@examples(3, 0.2)
@given(pieces(), st.lists(NAMES, max_size=30), st.data())
def test_ledger_of_any_piece(piece: PicturePiece, names: list[str], data: st.DataObject) -> None:
    shape = piece.surface
    entries = [
        SimpleNamespace(
            name=name,
            paths=[shape.vertices[:2]],
            per_cm=data.draw(st.sampled_from([0.0, -1.0, 1e-9, 3.0, 1e4])),
            released=0.1,
            model_energy_after=0.0,
            model_energy_before=0.0,
            length=9.0,
            opening=0.01,
            angle=np.nan,
        )
        for name in names
    ]
    result = SimpleNamespace(
        surface=shape,
        face_energy_density=piece.face_energy_density,
        stages=[SimpleNamespace(strain_energy_j=1e3)],
        worn=SimpleNamespace(area=face_areas(shape.vertices, shape.faces)),
    )
    ledger = SimpleNamespace(name=shape.name, pieces=[result], entries=entries, peaks=[])
    assert faults_written(write_ledger_picture, ledger) == []


@examples(3, 0.2)
@given(st.lists(shapes(), min_size=1, max_size=30), NAMES, st.sampled_from([0.0, 1e-3, 0.4]), MAPS)
def test_drape_and_correction_of_any_pieces(worn_pieces: list[Any], fabric: str, gap: float, kind: str) -> None:
    """The worn cloth lies on a body of its own size, and its pattern changes by a hundredth."""
    counts = np.cumsum([0, *(len(space) for _, space, *_ in worn_pieces)])
    rows = {name: slice(a, b) for (name, *_), a, b in zip(worn_pieces, counts, counts[1:], strict=False)}
    rows = {name: range(each.start, each.stop) for name, each in rows.items()}
    faces = np.concatenate([each[3] + first for each, first in zip(worn_pieces, counts, strict=False)]).astype(np.int32)
    space, flat = (np.concatenate([each[k] for each in worn_pieces]) for k in (1, 2))
    low, high = space.min(axis=0) - 0.1, space.max(axis=0) + 0.1
    corners = low + (high - low) * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)

    def drape_of(pattern: np.ndarray) -> Any:
        cloth = SimpleNamespace(
            faces=faces,
            flat_faces=faces,
            flat=pattern,
            piece_vertices=rows,
            fabric=SimpleNamespace(name=fabric, strain_limit=0.1, shear_limit=12.0),
        )
        return SimpleNamespace(
            cloth=cloth,
            body=SimpleNamespace(vertices=corners, triangles=triangles, shrunk=corners),
            positions=space,
            gap=np.full(len(space), gap),
            pressure=np.zeros(len(space)),
            strains={
                "warp": values(kind, len(faces), 0.1, 1),
                "weft": np.zeros(len(faces)),
                "shear": values(kind, len(faces), 10.0, 2),
            },
            face_areas=face_areas(space, faces),
            places=[],
            converged=False,
        )

    drape = drape_of(flat)
    assert faults_written(write_drape_picture, drape) == []
    both = {fabric: drape, "another": drape}
    assert faults_written(write_compared_drapes, both) == []
    rounds = [SimpleNamespace(misfit=0.01)]
    correction = Correction(before=drape, after=drape_of(1.01 * flat), rounds=tuple(rounds), reason="")  # type: ignore[arg-type]
    assert faults_written(write_correction_picture, correction) == []
