"""PDF as a printer sees it: rendered by poppler and measured."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import shapely
from PIL import Image
from polygons import corners_of, drafted, polygon, sewn
from pypdf import PdfReader

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.sewing_order import seam_letters
from warpflat.pattern.export.pdf import PAPERS, draw_sheet, too_many_sheets, write_pdf
from warpflat.pattern.export.pdf_legend import TEST_INCHES, TEST_MM
from warpflat.pattern.export.pdf_tiling import LEGEND_SIZE
from warpflat.pattern.export.svg import SIZE_COLOURS, write_svg

needs_poppler = pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="pdftoppm (poppler) is not installed")
MM = 1 / 25.4


@pytest.fixture(scope="module")
def files(dress, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pdf")
    return {p: (folder / f"{p}.pdf", write_pdf(dress, folder / f"{p}.pdf", paper=p, sizes=["38"])) for p in PAPERS}


def rendered(path, page, dpi, window=None):
    """One page, or a window (left, top, width, height in mm) of it, as grey levels."""
    command = ["pdftoppm", "-r", str(dpi), "-f", str(page), "-l", str(page), "-gray", "-singlefile"]
    if window is not None:
        left, top, width, height = (round(v * MM * dpi) for v in window)
        command += ["-x", str(left), "-y", str(top), "-W", str(width), "-H", str(height)]
    target = path.with_suffix("")
    subprocess.run([*command, str(path), str(target)], check=True, capture_output=True)
    return np.asarray(Image.open(target.with_suffix(".pgm")), dtype=float)


def first_pages(path, tiling):
    """How many pages of legend and guide stand before the sheets."""
    return len(PdfReader(path).pages) - len(tiling.tiles)


def line_places(levels, axis):
    """Centres [pixels] of the dark lines that cross the whole picture along an axis."""
    dark = 255 - levels.mean(axis=axis)
    above = dark > 0.4 * dark.max()
    runs = np.split(np.flatnonzero(above), np.flatnonzero(np.diff(np.flatnonzero(above)) > 1) + 1)
    return [float(np.average(run, weights=dark[run])) for run in runs]


@needs_poppler
@pytest.mark.parametrize("paper", ["A4", "Letter"])
def test_both_test_squares_measure_what_they_say(files, paper):
    path, _ = files[paper]
    kind, dpi = PAPERS[paper], 600
    left = (kind.margin + 0.005 + 0.001) * 1000
    top = (kind.margin + 0.002 + 0.037) * 1000
    for start, side in ((left, TEST_MM * 1000), (left + 57, TEST_INCHES * 1000)):
        across = rendered(path, 1, dpi, (start - 2, top + 10, side + 4, 5))
        places = line_places(across, 0)
        assert (places[-1] - places[0]) / dpi * 25.4 == pytest.approx(side, abs=0.1)
        down = rendered(path, 1, dpi, (start + 10, top - 2, 5, side + 4))
        places = line_places(down, 1)
        assert (places[-1] - places[0]) / dpi * 25.4 == pytest.approx(side, abs=0.1)


@needs_poppler
def test_the_cut_line_is_printed_where_the_layout_says(dress, files):
    """Every dark pixel row of a tile's cut line lies on the drafted outline, in millimetres."""
    path, tiling = files["A4"]
    row, column = tiling.tiles[0]
    dpi = 150
    levels = rendered(path, first_pages(path, tiling) + 1, dpi)
    paper = PAPERS["A4"]
    dark = np.argwhere(levels < 60)
    inches = np.column_stack([dark[:, 1] + 0.5, levels.shape[0] - dark[:, 0] - 0.5]) / dpi
    on_sheet = inches * 0.0254 - paper.margin + tiling.corner(row, column)
    placed = tiling.sheet.placed
    strokes = []
    for place in placed:
        for piece in place.pieces:
            # A fold is a line of dashes: it is not cut.
            ends = [edge.line[[0, -1]] for edge in piece.fold_edges]
            longer = [line + np.diff(line[::-1], axis=0) * [[1], [-1]] for line in ends]
            folds = [shapely.LineString(place.on_sheet(line)).buffer(1e-5) for line in longer]
            strokes += [shapely.LinearRing(place.on_sheet(piece.cut_line)).difference(shapely.union_all(folds))]
    rings = shapely.union_all(strokes)
    distance = shapely.distance(rings, shapely.points(on_sheet))
    cut = distance < 0.0003
    assert cut.sum() > 2000, "the cut line is on the page"
    # Seen the other way round: every stretch of outline in the window is dark somewhere.
    window = shapely.box(*tiling.corner(row, column), *(tiling.corner(row, column) + paper.step))
    inside = shapely.segmentize(rings.intersection(window.buffer(-0.002)), 0.005)
    samples = shapely.points(shapely.get_coordinates(inside))
    tree = shapely.STRtree(shapely.points(on_sheet))
    _, gaps = tree.query_nearest(samples, return_distance=True, all_matches=False)
    assert gaps.max() < 0.0004


@needs_poppler
def test_neighbouring_tiles_show_the_same_strip(files):
    path, tiling = files["A4"]
    pairs = [(i, tiling.tiles.index((r, c + 1))) for i, (r, c) in enumerate(tiling.tiles) if (r, c + 1) in tiling.tiles]
    below = [(i, tiling.tiles.index((r + 1, c))) for i, (r, c) in enumerate(tiling.tiles) if (r + 1, c) in tiling.tiles]
    paper, dpi = PAPERS["A4"], 120
    width, height, margin = (v * 1000 for v in (paper.width, paper.height, paper.margin))
    overlap = paper.overlap * 1000
    seen, before = 0, first_pages(path, tiling) + 1
    for (first, second), sideways in [(p, True) for p in pairs[:2]] + [(p, False) for p in below[:2]]:
        if sideways:
            a = rendered(
                path, first + before, dpi, (width - margin - overlap, margin + 20, overlap, height - 2 * margin - 40)
            )
            b = rendered(path, second + before, dpi, (margin, margin + 20, overlap, height - 2 * margin - 40))
        else:
            a = rendered(
                path, first + before, dpi, (margin + 20, height - margin - overlap, width - 2 * margin - 40, overlap)
            )
            b = rendered(path, second + before, dpi, (margin + 20, margin, width - 2 * margin - 40, overlap))
        # Marks are grey, the pattern is black; a pixel of rounding between two pages is allowed.
        dark_a, dark_b = a < 60, b < 60
        seen += int(dark_a.sum())
        near = np.zeros_like(dark_b)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                near |= np.roll(dark_b, (dy, dx), axis=(0, 1))
        assert (dark_a & ~near)[1:-1, 1:-1].sum() == 0
    assert seen > 50


def test_the_file_asks_for_no_scaling_and_has_the_right_pages(files):
    for paper, (path, tiling) in files.items():
        data = path.read_bytes()
        assert b"/PrintScaling /None" in data
        sizes = [
            [float(page.mediabox.width) * 0.0254 / 72, float(page.mediabox.height) * 0.0254 / 72]
            for page in PdfReader(path).pages
        ]
        # The first pages are read at the machine: they are small, whatever the pattern is printed on.
        before, small = first_pages(path, tiling), PAPERS[paper if PAPERS[paper].tiled else "A4"]
        assert 1 <= before <= 3
        for size in sizes[:before]:
            np.testing.assert_allclose(size, [small.width, small.height], atol=1e-6)
        for size in sizes[before:]:
            np.testing.assert_allclose(size, [tiling.paper.width, tiling.paper.height], atol=1e-6)


def test_no_part_of_a_piece_is_left_unprinted(files):
    for paper, (_, tiling) in files.items():
        step, overlap = tiling.paper.step, tiling.paper.overlap
        printed = shapely.union_all(
            [shapely.box(*(c := tiling.corner(*t)), *(c + step + overlap)) for t in tiling.tiles]
        )
        for place in tiling.sheet.placed:
            for piece in place.pieces:
                assert printed.buffer(1e-9).contains(shapely.Polygon(place.on_sheet(piece.cut_line))), paper


def test_copy_shop_sheets_keep_pieces_whole(files):
    _, tiling = files["A0"]
    assert not tiling.joined
    assert len(tiling.tiles) <= 2
    (legend,) = [tiling.sheet.reserved]
    block = shapely.box(*legend, *(legend + LEGEND_SIZE))
    for place in tiling.sheet.placed:
        for piece in place.pieces:
            assert block.distance(shapely.Polygon(place.on_sheet(piece.cut_line))) > 0.005


def test_rows_are_letters_and_columns_numbers(files):
    _, tiling = files["A4"]
    assert tiling.name(0, 0) == "A1"
    assert tiling.name(1, 2) == "B3"
    assert tiling.name(26, 0) == "AA1"


@needs_poppler
def test_letters_of_any_alphabet_are_embedded(files):
    shown = subprocess.run(["pdffonts", str(files["A4"][0])], capture_output=True, text=True, check=True).stdout
    fonts = [line for line in shown.splitlines()[2:] if line.strip()]
    assert any("DejaVuSans" in line for line in fonts)
    text = subprocess.run(["pdftotext", str(files["A4"][0]), "-"], capture_output=True, text=True, check=True).stdout
    assert "Print at 100 %" in text
    assert "front bodice to back bodice" in " ".join(text.split())
    assert "Cut 1 on fold" in text


def test_the_same_pattern_gives_the_same_bytes(dress, tmp_path):
    for name in ("a.pdf", "b.pdf"):
        write_pdf(dress, tmp_path / name, sizes=["36", "38"])
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


@needs_poppler
@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext (poppler) is not installed")
def test_names_on_the_first_page_stay_on_it_and_on_their_pieces(tmp_path):
    """By the boxes of words that poppler finds: what has no room in the overview is a number of the list above it."""
    shapes = {"tab_of_the_left_front": (0.01, 0.01), "front": (0.3, 0.6), "waistband_facing": (0.5, 0.05)}
    pieces = [polygon(name, corners_of(*size)) for name, size in shapes.items()]
    name = "a_garment_with_a_name_that_is_far_too_long_for_the_width_of_the_page"
    write_pdf(draft_garment(Pattern(name=name, pieces={"": pieces})), tmp_path / "p.pdf")
    told = subprocess.run(
        ["pdftotext", "-f", "1", "-l", "1", "-bbox", str(tmp_path / "p.pdf"), "-"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    found = re.findall(r'<word xMin="(.*?)" yMin="(.*?)" xMax="(.*?)" yMax="(.*?)">(.*?)</word>', told)
    right = (PAPERS["A4"].width - PAPERS["A4"].margin) / 0.0254 * 72
    assert all(float(word[2]) < right for word in found)
    words = [word[4] for word in found]
    below = words[words.index("left", words.index("glue.")) :]
    assert "front" in below
    assert "waistband" in below
    assert "tab" not in below
    assert "1" in below, "its number in the list"


def test_a_sheet_shows_words_whole_or_not_at_all(dress, tmp_path):
    path = tmp_path / "tiled.pdf"
    tiling = write_pdf(dress, path, sizes=["38"])
    _, drawings = draw_sheet(halved(replace(dress, pieces={"38": dress.pieces["38"]})), "A4")
    inner = np.array([tiling.paper.width, tiling.paper.height]) - 2 * tiling.paper.margin
    pages = PdfReader(path).pages[first_pages(path, tiling) :]
    shown = ["".join(page.extract_text().split()) for page in pages]
    texts = Counter(words.text for row in drawings for words in row[0].words)
    for placed, row in zip(tiling.sheet.placed, drawings, strict=True):
        for words in row[0].words:
            low, high = (f(placed.on_sheet(words.box()), axis=0) for f in (np.min, np.max))
            corners = {tile: tiling.corner(*tile) for tile in tiling.tiles}
            shows = [tile for tile, c in corners.items() if (low >= c).all() and (high <= c + inner).all()]
            assert shows, f"{words.text} is whole on no sheet"
            # A reader finds all letters of a form, seen or not.
            if sum(words.text in text for text in texts.elements()) == 1 and len(words.text) > 6:
                found = ["".join(words.text.split()) in text for text in shown]
                assert found == [tile in shows for tile in tiling.tiles]


def test_a_size_has_its_colour_on_pieces_that_not_all_sizes_have(tmp_path):
    sizes = ("S", "M", "L")
    rows = {size: [polygon("front", corners_of(0.1 + 0.02 * k, 0.2), size=size)] for k, size in enumerate(sizes)}
    rows["S"] = [polygon("yoke", corners_of(0.1, 0.2), size="S")]
    nest = draft_garment(Pattern(name="top", pieces=rows))
    write_pdf(nest, tmp_path / "p.pdf")
    reader = PdfReader(tmp_path / "p.pdf")
    forms = (form.get_object() for page in reader.pages for form in page["/Resources"].get("/XObject", {}).values())
    drawn = next(form for form in forms if b"/size1 BDC" in form.get_data()).get_data().decode("latin-1")
    write_svg(nest, tmp_path / "p.svg")
    text = (tmp_path / "p.svg").read_text()
    for k, size in enumerate(sizes[1:], 1):
        shade = [int(SIZE_COLOURS[k][at : at + 2], 16) / 255 for at in (1, 3, 5)]
        used = re.search(rf"/size{k} BDC\s+(\S+) (\S+) (\S+) RG", drawn)
        assert [float(each) for each in used.groups()] == pytest.approx(shade, abs=1e-3)
        group = text[text.index(f'id="front-{size}"') :].partition("</g>")[0]
        assert f"stroke: {SIZE_COLOURS[k]}" in group


def test_unknown_paper_is_refused(dress, tmp_path):
    with pytest.raises(InputError, match="did you mean 'A4'"):
        write_pdf(dress, tmp_path / "p.pdf", paper="A44")
    assert list(tmp_path.iterdir()) == []


def test_every_seam_has_its_letter_on_the_sheets():
    """Seams that are too short for a notch, such as a shoulder of 5 cm, have it on both edges."""
    pieces = [polygon(name, corners_of(0.05, 0.3)) for name in ("front", "back")]
    seams = [sewn("front.e0", "back.e2", "shoulder"), sewn("front.e1", "back.e3", "side")]
    garment = draft_garment(Pattern(name="top", pieces={"": pieces}, seams=seams))
    notched = {notch.seam for piece in garment.pieces[""] for notch in piece.notches}
    assert notched == {"side"}
    letters = set(seam_letters(garment).values())
    assert len(letters) == 2
    _, drawings = draw_sheet(halved(garment), "A4")
    for (drawing,) in drawings:
        assert letters <= {words.text for words in drawing.words}


def test_sheets_are_counted_as_they_are_printed() -> None:
    """A run and an export refuse the same patterns: of a piece on the fold half is printed."""
    whole = drafted(polygon("awning", corners_of(10.0, 6.0)))
    assert [too_many_sheets(each, "A4") for each in (whole, halved(whole))] == ["", ""]
    assert "sheets" in too_many_sheets(drafted(polygon("tent", corners_of(20.0, 6.0))), "A4")
