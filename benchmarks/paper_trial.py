"""Print a pattern, join its sheets, cut, unfold and sew it, all in software: does every seam close?

    python benchmarks/paper_trial.py scenes/dress.toml [MORE.toml ...]   # or folders of finished runs

Only what is printed is measured. Sheets are read from the PDF and joined by their marks, as a sewer does: cut along the
left and upper line, laid on the lines of the neighbours. Closed cutting lines are the pieces. Those with a fold are
unfolded. The seam table says which edges meet; the lengths of printed sewing lines and the places of printed notches are
compared. Needs pypdf.
"""

from __future__ import annotations

import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely.affinity import affine_transform

from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.export.pattern_json import read_pattern_json
from warpflat.pattern.export.svg import STYLE

MM = 25.4 / 72
#: Half the width [mm] with which printed lines are joined, and how far a printed line may lie from its edge.
REACH, NEAR = 0.05, 0.3
#: Slits of one notch stand closer than this [mm].
DOUBLE = 9.0


@dataclass
class Sheet:
    """One printed sheet: what shows on it (role, line [mm]), its window, its joining lines (x, y) from low to high."""

    name: str
    strokes: list[tuple[str, shapely.LineString]]
    window: shapely.Polygon
    x: tuple[float, float]
    y: tuple[float, float]


@dataclass
class Cut:
    """A piece as cut from the joined sheets: its outline and the lines on it [mm], by role; the half that was unfolded."""

    outline: shapely.Polygon
    lines: dict[str, list[shapely.LineString]]
    half: Cut | None = None


def read_sheets(path: Path) -> list[Sheet]:
    """Read the sheets with pattern on them from a PDF."""
    from pypdf import PdfReader
    from pypdf.generic import ContentStream

    reader, sheets = PdfReader(path), []
    drawn: list[tuple[str, np.ndarray]] | None = None
    for page in reader.pages:
        named = re.search(r"sheet ([A-Z]+\d+) ", page.extract_text() or "")
        if named is None:
            continue
        operations = ContentStream(page.get_contents(), reader).operations
        if drawn is None:
            form = page["/Resources"]["/XObject"]["/FormXob.sheet"]
            drawn = _paths(ContentStream(form.get_object(), reader).operations)
        box = next(args for args, op in operations if op == b"re")
        shift = next(args for args, op in reversed([o for o in operations if o[1] == b"cm"]))[4:]
        left, low, width, height = (float(v) * MM for v in box)
        window = shapely.box(left, low, left + width, low + height)
        shift = np.array([float(v) for v in shift])
        strokes = []
        for role, points in drawn:
            part = shapely.LineString((points + shift) * MM).intersection(window)
            strokes += [
                (role, line) for line in shapely.get_parts(part) if line.geom_type == "LineString" and not line.is_empty
            ]
        marks = [points * MM for role, points in _paths(operations) if role == "mark" and len(points) == 2]
        long = [m for m in marks if np.abs(m[1] - m[0]).max() > 50]
        x = sorted({round(float(m[0, 0]), 4) for m in long if abs(m[1, 0] - m[0, 0]) < 0.01}) or [left, left + width]
        y = sorted({round(float(m[0, 1]), 4) for m in long if abs(m[1, 1] - m[0, 1]) < 0.01}) or [low, low + height]
        sheets.append(Sheet(named[1], strokes, window, (x[0], x[-1]), (y[0], y[-1])))
    return sheets


def _paths(operations: list) -> list[tuple[str, np.ndarray]]:
    """Return stroked paths in order, with the roles that the legend gives to their kind of line."""
    kinds: dict[tuple, str] = {}
    for role, (_, line_width, dashes) in STYLE.items():
        kinds.setdefault((round(line_width, 2), tuple(round(d, 2) for d in dashes)), role)
    kinds[0.11, ()] = "mark"
    found, points, closed, width, dash = [], [], False, 1.0, ()
    for args, op in operations:
        numbers = np.array([float(a) for a in args]) if op in (b"m", b"l", b"c") else None
        if op == b"w":
            width = float(args[0]) * MM
        elif op == b"d":
            dash = tuple(round(float(d) * MM, 2) for d in args[0])
        elif op == b"m":
            points, closed = [numbers], False
        elif op == b"l":
            points.append(numbers)
        elif op == b"c":
            control = np.vstack([points[-1], numbers.reshape(3, 2)])
            t = np.linspace(0, 1, 25)[1:, None]
            points += list(((1 - t) ** 3) * control[0] + 3 * t * (1 - t) ** 2 * control[1]
                           + 3 * t**2 * (1 - t) * control[2] + t**3 * control[3])  # fmt: skip
        elif op == b"h":
            closed = True
        elif op == b"S" and len(points) > 1:
            role = kinds.get((round(width, 2), dash))
            if role is not None:
                found.append((role, np.array(points + points[:1] if closed else points)))
    return found


def join_sheets(sheets: list[Sheet]) -> list[tuple[str, shapely.LineString]]:
    """Lay each sheet on the lines of its left and upper neighbours, and return what then shows."""
    by_name = {sheet.name: sheet for sheet in sheets}
    places: dict[str, np.ndarray] = {}
    for start in by_name:
        if start in places:
            continue
        places[start], queue = np.array([0.0, -1e5 * len(places)]), [start]
        while queue:
            name = queue.pop()
            here = by_name[name]
            for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                other = by_name.get(_neighbour(name, down, right))
                if other is None or other.name in places:
                    continue
                dx = here.x[max(right, 0)] - other.x[max(-right, 0)] if right else here.x[0] - other.x[0]
                dy = here.y[max(-down, 0)] - other.y[max(down, 0)] if down else here.y[0] - other.y[0]
                places[other.name] = places[name] + [dx, dy]
                queue.append(other.name)
    shown = []
    for sheet in sheets:
        at = places[sheet.name]
        over = []
        for down, right in ((0, 1), (1, 0), (1, 1)):
            other = by_name.get(_neighbour(sheet.name, down, right))
            if other is not None:
                low, high = np.array(other.window.bounds[:2]), np.array([other.window.bounds[2], other.y[1]])
                low[0] = other.x[0]
                over.append(shapely.box(*(low + places[other.name]), *(high + places[other.name])))
        covered = shapely.union_all(over)
        mine = shapely.box(sheet.x[0], sheet.window.bounds[1], sheet.window.bounds[2], sheet.y[1])
        for role, line in sheet.strokes:
            # On the first row and column nothing lies beyond the lines.
            part = line.intersection(mine.buffer(1e-6))
            part = affine_transform(part, [1, 0, 0, 1, *at]).difference(covered)
            shown += [(role, p) for p in shapely.get_parts(part) if p.geom_type == "LineString" and not p.is_empty]
    return shown


def _neighbour(name: str, down: int, right: int) -> str:
    """Return the name of a sheet so many rows down and columns to the right."""
    letters, column = re.fullmatch(r"([A-Z]+)(\d+)", name).groups()
    row = 0
    for letter in letters:
        row = 26 * row + ord(letter) - ord("A") + 1
    row, words = row + down, ""
    while row > 0:
        row, digit = divmod(row - 1, 26)
        words = chr(ord("A") + digit) + words
    return f"{words}{int(column) + right}"


def cut_pieces(shown: list[tuple[str, shapely.LineString]]) -> list[Cut]:
    """Cut along the lines: every closed cutting line, with its fold if it has one, is a piece; unfold halves."""
    borders = [line for role, line in shown if role in ("cut", "fold")]
    ink = shapely.union_all([line.buffer(REACH, cap_style="square") for line in borders])
    outlines = [shapely.Polygon(hole) for part in shapely.get_parts(ink) for hole in part.interiors]
    pieces = []
    for outline in outlines:
        if outline.area < 100:
            continue
        near = outline.buffer(2 * REACH)
        lines: dict[str, list[shapely.LineString]] = {}
        for role, line in shown:
            inside = line.intersection(near)
            lines.setdefault(role, []).extend(p for p in shapely.get_parts(inside) if p.length > 1e-6)
        piece = Cut(outline.buffer(REACH, join_style="mitre"), lines)
        pieces.append(_unfolded(piece))
    return pieces


def _unfolded(piece: Cut) -> Cut:
    folds = piece.lines.get("fold", [])
    if not folds:
        return piece
    ends = shapely.get_coordinates(shapely.MultiLineString(folds))
    start, end = ends[np.argmin(ends @ [1, 1])], ends[np.argmax(ends @ [1, 1])]
    x, y = (end - start) / np.linalg.norm(end - start)
    turn = np.array([[2 * x * x - 1, 2 * x * y], [2 * x * y, 2 * y * y - 1]])
    matrix = [*turn[0], *turn[1], *(start - turn @ start)]
    halves = [piece.outline, affine_transform(piece.outline, matrix)]
    whole = shapely.union_all([half.buffer(2 * REACH) for half in halves]).buffer(-2 * REACH)
    lines = {role: rows + [affine_transform(r, matrix) for r in rows] for role, rows in piece.lines.items()}
    return Cut(whole, {role: rows for role, rows in lines.items() if role != "fold"}, half=piece)


def find_piece(cuts: list[Cut], piece: DraftedPiece) -> Cut:
    """Return the cut piece that is this one, turned and moved to where the pattern has it [mm]."""
    wanted = shapely.Polygon(1000 * piece.cut_line)
    seams = shapely.union_all([shapely.LineString(1000 * edge.line) for edge in piece.edges if edge.kind == "seam"])
    notches = shapely.MultiPoint([1000 * np.asarray(notch.at) for notch in piece.notches])
    best, found = np.inf, None
    halves = [cut.half for cut in cuts if cut.half is not None] if piece.piece.on_fold else []
    for cut in halves or cuts:
        for quarters in range(4):
            a, b = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters]
            turned = affine_transform(cut.outline, [a, -b, b, a, 0, 0])
            shift = np.array(wanted.bounds[:2]) - turned.bounds[:2]
            away = affine_transform(turned, [1, 0, 0, 1, *shift]).symmetric_difference(wanted).area
            if away < 0.01 * wanted.area:
                # A strip is its own image when it is turned by half: its sewing lines and notches tell the two apart.
                sewn, marks = (
                    shapely.union_all([affine_transform(row, [a, -b, b, a, *shift]) for row in cut.lines.get(role, [])])
                    for role in ("sew", "notch")
                )
                away += NEAR * seams.difference(sewn.buffer(NEAR)).length
                away += sum(min(marks.distance(at), 10.0) for at in notches.geoms if not marks.is_empty)
            if away < best:
                best, found = away, (cut, [a, -b, b, a, *shift])
    if found is None or best > 0.02 * wanted.area:
        raise SystemExit(f"{piece.name} is not among the printed pieces")
    cut, matrix = found
    # Cloth that shrinks has shrunk before it is sewn.
    across, along = piece.enlarged
    matrix = [
        matrix[0] / across,
        matrix[1] / across,
        matrix[2] / along,
        matrix[3] / along,
        matrix[4] / across,
        matrix[5] / along,
    ]
    return Cut(
        affine_transform(cut.outline, matrix),
        {role: [affine_transform(line, matrix) for line in rows] for role, rows in cut.lines.items()},
    )


class PrintedSide:
    """One side of a seam: the length of its printed sewing lines, its joints and its printed notches [mm]."""

    def __init__(self, side, cuts: dict[str, Cut], pieces: dict[str, DraftedPiece]) -> None:
        self.joints, self.notches = [0.0], []
        for part in side:
            cut, edge = cuts[part.piece], pieces[part.piece].edge(part.edge)
            line = shapely.LineString(1000 * edge.line / np.array(pieces[part.piece].enlarged))
            corridor = line.buffer(NEAR, cap_style="flat")
            roles = ("sew", "hem", "dart", "internal") if edge.kind == "dart" else ("sew", "hem")
            # A stroke of this edge lies in its corridor; a neighbour's only touches it at the corner.
            printed = [stroke for role in roles for stroke in cut.lines.get(role, [])]
            length = sum(p.length for p in printed if p.intersection(corridor).length > 0.5 * p.length)
            start = self.joints[-1]
            for at in _merged(self._places(cut, line, edge.width)):
                at *= length / line.length
                self.notches.append(start + (length - at if part.reversed else at))
            self.joints.append(start + length)

    @property
    def length(self) -> float:
        return self.joints[-1]

    @staticmethod
    def _places(cut: Cut, line: shapely.LineString, width: float) -> list[float]:
        """Return where notches point to a line, along it."""
        places = []
        for stroke in cut.lines.get("notch", []):
            start, end = np.array(stroke.coords[0]), np.array(stroke.coords[-1])
            along = (end - start) / np.linalg.norm(end - start)
            if max(line.distance(shapely.Point(p)) for p in (start, end)) > 1000 * width + 1.0:
                continue
            if line.distance(shapely.Point(end)) > line.distance(shapely.Point(start)):
                along = -along
            hit = shapely.LineString([end - 2 * along, end + (1000 * width + 2) * along]).intersection(line)
            if not hit.is_empty:
                places.append(float(line.project(shapely.Point(shapely.get_coordinates(hit)[0]))))
        return sorted(places)


def _merged(places: list[float]) -> list[float]:
    """Return notches, both slits of a double one as one."""
    merged: list[list[float]] = []
    for place in places:
        if merged and place - merged[-1][0] < DOUBLE:
            merged[-1].append(place)
        else:
            merged.append([place])
    return [float(np.mean(group)) for group in merged]


def sew(garment: DraftedGarment, size: str, cuts: list[Cut]) -> list[tuple[str, float, float, int]]:
    """Return for each seam how far it fails to close and how far notches miss partners [mm], and their number."""
    pieces = {piece.name: piece for piece in garment.pieces[size]}
    found = {name: find_piece(cuts, piece) for name, piece in pieces.items()}
    rows = []
    for seam in garment.pattern.seams:
        first, second = (PrintedSide(side, found, pieces) for side in seam.sides)
        gap = second.length - first.length * (1 + seam.ease)
        worst = 0.0
        for one, other in ((first, second), (second, first)):
            partners = np.array([*other.notches, *other.joints]) / other.length
            worst = max([worst, *(float(np.abs(partners - n / one.length).min()) * one.length for n in one.notches)])
        rows.append((seam.name, gap, worst, len(first.notches) + len(second.notches)))
    return rows


def try_pattern(pattern: Path, pdf: Path | None = None, paper: str = "A4") -> tuple[list, int, int]:
    """Print a `pattern.json` (or take its PDF), cut and sew it; return the seams, pieces found and sheets."""
    from warpflat.pattern.export.pdf import write_pdf

    garment = read_pattern_json(pattern)
    size = garment.pattern.sample
    with tempfile.TemporaryDirectory() as folder:
        if pdf is None:
            pdf = Path(folder) / "pattern.pdf"
            write_pdf(garment, pdf, paper=paper, sizes=[size])
        sheets = read_sheets(pdf)
    cuts = cut_pieces(join_sheets(sheets))
    return sew(garment, size, cuts), len(cuts), len(sheets)


def main() -> None:
    """Try scenes or folders of finished runs."""
    for argument in sys.argv[1:]:
        source = Path(argument)
        with tempfile.TemporaryDirectory() as folder:
            if source.suffix == ".toml":
                from warpflat.app.scene.load import load_scene
                from warpflat.app.scene.run import run_scene

                run_scene(load_scene(source), Path(folder))
                source = Path(folder)
            rows, pieces, sheets = try_pattern(source / "pattern.json")
        gap = max((abs(row[1]) for row in rows), default=0.0)
        miss = max((row[2] for row in rows), default=0.0)
        print(f"{argument}: {sheets} sheets, {pieces} pieces, {len(rows)} seams close within {gap:.3f} mm, "
              f"{sum(row[3] for row in rows)} notches meet within {miss:.3f} mm")  # fmt: skip
        for name, opened, missed, notches in rows:
            if abs(opened) > 0.5 or missed > 0.5:
                print(f"  {name}: open by {opened:+.2f} mm, notches miss by {missed:.2f} mm ({notches})")


if __name__ == "__main__":
    main()
