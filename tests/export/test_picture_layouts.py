"""Pictures of pieces of every number, size, shape, name and map are drawn, and all their words are on the page.

Examples are few here. `WARPFLAT_LAYOUTS=5000` tries so many of each kind.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from export_meshes import grid, surface
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warpflat.export.letters import all_letters
from warpflat.export.picture import PicturePiece, draw_figure
from warpflat.export.picture_garment import Body
from warpflat.export.picture_pen import DPI, PAGE_WIDTH

EXAMPLES = int(os.environ.get("WARPFLAT_LAYOUTS", "0"))
LONGEST_SIDE, PIXELS = 60_000, 150_000_000


def examples(few: int, share: float = 1.0) -> Any:
    return settings(
        max_examples=max(few, round(share * EXAMPLES)),
        derandomize=not EXAMPLES,
        database=None,
        deadline=None,
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


def check_page(figure: Any, *, words: bool = True) -> None:
    """The page is drawn, of a size that viewers open, with all its words on it."""
    canvas = figure.canvas
    with all_letters():
        canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())
    height, width = pixels.shape[:2]
    assert 300 < width <= LONGEST_SIDE
    assert 100 < height <= LONGEST_SIDE
    assert width * height <= PIXELS
    renderer = canvas.get_renderer()
    for text in [text for axes in figure.axes for text in axes.texts] + figure.texts if words else []:
        if text.get_text() and text.get_visible():
            box = text.get_window_extent(renderer)
            outside = max(-box.x0, box.x1 - width, -box.y0, box.y1 - height)
            assert outside < 2, (text.get_text(), box, width, height)


@examples(12)
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
    check_page(figure)
