"""`review.html`: one file with which a run is reviewed, offline: film, numbers, seams, darts and pictures."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import struct
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from warpflat.app.review.faults import faults_of
from warpflat.app.review.figures import count_pieces, seam_figures
from warpflat.app.review.film import open_film, pack_film, pack_foreign_film
from warpflat.core import InputError, energy_words, guarded, open_file, read_result, report_activity
from warpflat.pattern import SMALLEST_SCALE, Scale, atomic_path, latest_file, output_folder, record_file, recorded_files

__all__ = ["pack_frames", "pack_pictures", "read_run", "review_folder", "write_review"]


# Nothing on the page may ask for anything from elsewhere, nor from the disk.
_POLICY = "default-src 'none'; img-src data:; script-src 'unsafe-inline'; style-src 'unsafe-inline'"
# Pictures come in this order, and others after them.
_FIRST = ("picture.png", "drape.png", "wear.png", "walked.png")
_QUALITY = 85  # of JPEG
# What maps of the film are called, and the states of the cloth in which they hold.
_MAPS = {"pressure": "pressure on the skin", "gap": "gap to the body"}
_STATES = {"designed": ", as designed", "draped": ", draped"}
# Cloth that is longer by more than this when worn is stretched on purpose, if it fits.
STRETCHED = 0.02
_PNG = b"\x89PNG\r\n\x1a\n"
# The largest picture, which takes 3 bytes of memory for each pixel, and the largest file that the page holds.
_MOST_PIXELS = 150_000_000
# Larger ones, as of hundreds of pieces, stay as they are: decoded they would take hundreds of megabytes.
_DECODED = 30_000_000
_MOST_BYTES = 200_000_000


def read_run(folder: Path) -> tuple[dict[str, Any], list[str], str]:
    """Read what a run has left in a folder: its metrics, the names of its files, and its name.

    Raises:
        InputError: there is no `metrics.json` of warpflat, or a file that it lists is a link, a pipe or a device.
    """
    path = folder / "metrics.json"
    metrics = read_result(path)
    if not isinstance(metrics, dict) or not isinstance(metrics.get("pieces"), dict) or not metrics["pieces"]:
        raise InputError(f"{path}: is not of a run of warpflat; give the folder that `warpflat run` has written")
    runs = recorded_files(metrics)
    name = next(reversed(runs), folder.resolve().name)
    listed = [file for file in runs.get(name, {}) if os.path.lexists(folder / file)]
    for file in listed:
        open_file(folder / file).close()
    return metrics, listed, name


def review_folder(folder: str | Path) -> Path:
    """Write `review.html` into the folder of an earlier run; return its path.

    Raises:
        InputError: the folder holds no run, a file of it cannot be read, or the page cannot be written.
    """
    folder = Path(folder)
    metrics, files, name = read_run(folder)
    with output_folder(folder, ["review.html"], guard=True):
        film = pack_foreign_film(folder / "frames.usdc") if "frames.usdc" in files else None
        with guarded(folder / "metrics.json", "JSON"):
            write_review(folder, metrics, files, name=name, film=film)
        record_file(folder, name, "review.html")
    return folder / "review.html"


def pack_frames(folder: Path) -> dict[str, Any] | None:
    """Pack the `frames.usdc` of a folder for the page; None if it is too large for one.

    Raises:
        InputError: it is no USD file.
    """
    return pack_film(open_film(latest_file(folder / "frames.usdc")))


def pack_pictures(folder: Path, files: Sequence[str]) -> dict[str, str]:
    """Pack the pictures among the files of a folder for the page; return them by name."""
    from PIL import Image

    packed = dict[str, str]()
    for file in files:
        if not file.endswith(".png") or file == "contact_sheet.png":
            continue
        path = latest_file(folder / file)
        best, kind, small = _bytes(path), "png", io.BytesIO()
        # No other format is tried, some of which start a program; and the size is known before a pixel is decoded.
        wide, high = struct.unpack(">II", best[16:24]) if best[:8] == _PNG and len(best) >= 24 else (0, 0)
        if not 0 < wide * high <= _MOST_PIXELS:
            raise InputError(f"{path}: is no PNG of at most {_MOST_PIXELS:,} pixels; run the scene again")
        with guarded(path, "picture"), Image.open(io.BytesIO(best), formats=["PNG"]) as picture:
            if max(picture.size) < 65_000 and wide * high <= _DECODED:
                # As JPEG where that is smaller. WebP has half the bytes, and takes ten times as long.
                (picture if picture.mode == "RGB" else picture.convert("RGB")).save(small, "JPEG", quality=_QUALITY)
                if len(small.getvalue()) < len(best):
                    best, kind = small.getvalue(), "jpeg"
        packed[file] = f"data:image/{kind};base64,{base64.b64encode(best).decode('ascii')}"
    return packed


def write_review(
    folder: Path,
    metrics: Mapping[str, Any],
    files: Sequence[str],
    *,
    name: str,
    film: Mapping[str, Any] | None,
    pictures: Mapping[str, str] | None = None,
) -> None:
    """Write `review.html`.

    Args:
        folder: of the run.
        metrics: as `metrics.json`.
        files: what the run has written, by name.
        name: of the run.
        film: what :func:`pack_frames` has made of this folder; None if that cannot be shown.
        pictures: of :func:`pack_pictures`, those that were packed before.

    Raises:
        InputError: the film cannot be read, or the page cannot be written.
    """
    report_activity("writing the review page")
    path = folder / "review.html"
    page = _page(folder, metrics, files, name, film, pictures or {})
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _page(
    folder: Path,
    metrics: Mapping[str, Any],
    files: Sequence[str],
    name: str,
    film: Mapping[str, Any] | None,
    pictures: Mapping[str, str],
) -> str:
    shown_film = "" if film is None else _film(film)
    if film is None and "frames.usdc" in files:
        shown_film = "<p>The film is too large for a page, or could not be packed; see frames.usdc.</p>"
    notes = [f"{piece}: {note}" for piece, entry in metrics["pieces"].items() for note in entry.get("notes", ())]
    shown = {**pack_pictures(folder, [file for file in files if file not in pictures]), **pictures}
    # What pictures show, for who does not see them.
    shows = {
        "picture.png": f"{name} in space beside its pattern, coloured by strain energy",
        "drape.png": f"{name} worn: gap to the body and strain, from the front, the side and the back",
        "wear.png": "Strain of each piece when worn, along the warp and the weft",
        "walked.png": "The two sides of every seam laid along each other",
        "corrected.png": "Outlines before and after the correction",
    }
    images = []
    for file in sorted(shown, key=lambda file: (_FIRST.index(file) if file in _FIRST else len(_FIRST), file)):
        # Of a mesh it begins with the name of its piece.
        kind = "wear.png" if file.endswith(".wear.png") else file
        words = shows.get(kind, file.removesuffix(".png").replace("_", " ").replace(".", " "))
        images.append(_thumbnail(escape(words), shown[file]))
    drawings = []
    for file in sorted(file for file in files if file.endswith(".svg")):
        text = base64.b64encode(_bytes(latest_file(folder / file))).decode("ascii")
        words = f"The pattern of {escape(name)}: cutting and sewing lines, notches and labels"
        drawings.append(_thumbnail(words, f"data:image/svg+xml;base64,{text}"))
    # Size, errors and energy of every piece.
    rows = [
        (
            name,
            f"{piece['vertices']:,}",
            f"{piece['faces']:,}",
            f"{1e4 * piece['area_m2']:,.0f} cm²",
            f"{100 * piece['length_error']:.3g} %",
            f"{100 * piece['area_error']:.3g} %",
            f"{100 * piece['boundary_error']:.3g} %",
            str(piece["flipped_faces"]),
        )
        for name, piece in metrics["pieces"].items()
    ]
    head = ("piece", "vertices", "faces", "area", "length error", "area error", "border error", "flips")
    worn = ""
    if "drape.webp" in files:
        text = base64.b64encode(_bytes(latest_file(folder / "drape.webp"))).decode("ascii")
        worn = (
            _thumbnail("The garment comes to rest on the body", f"data:image/webp;base64,{text}")
            + "<p>Front, left side and back, coloured by the gap to the body; frames.usdc holds the same in space.</p>"
        )
    # The files lie beside the page.
    links = "".join(
        f'<li><a href="{quote(file)}">{escape(file)}</a></li>'
        for file in sorted(set(files), key=lambda file: (file != "pattern.pdf", file))
    )
    sections = [
        ("", verdict_words(metrics) + _cards(metrics)),
        ("Ease", ease_table(metrics)),
        ("From the development to rest", shown_film),
        ("Worn: from the designed surface to rest", worn),
        ("Pictures", f'<div class="thumbnails">{"".join(images + drawings)}</div>' if images or drawings else ""),
    ]
    # What few look for is one click away.
    folded = [
        ("Cuts and darts", ledger_table(metrics)),
        ("Seams", seam_table(metrics)),
        ("Pieces", _table(head, rows)),
        ("Energy, stage by stage", energy_table(metrics)),
        ("Body", size_table(metrics)),
        ("Notes", "<ul>" + "".join(f"<li>{escape(note)}</li>" for note in notes) + "</ul>" if notes else ""),
        ("Files", f'<ul class="files">{links}</ul>'),
    ]
    body = "".join(f"<h2>{title}</h2>{content}" if title else content for title, content in sections if content)
    body += "".join(f"<details><summary>{title}</summary>{content}</details>" for title, content in folded if content)
    script = f"<script>{_data('viewer.js')}</script>" if film else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(name)} - review</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_data("page.css")}</style></head>'
        f'<body><main><h1>{escape(name)}</h1><p class="sub">warpflat {escape(str(metrics["warpflat"]))}</p>'
        f"{body}</main>{script}</body></html>\n"
    )


def _film(packed: Mapping[str, Any]) -> str:
    """Return the film with its buttons and scales as HTML."""
    # No text of a film may end the script it stands in.
    data = json.dumps(packed, separators=(",", ":")).replace("<", "\\u003c")
    buttons = "".join(
        f'<button data-view="{view}">{view.capitalize()}</button>'
        for view in ("all", "front", "side", "back", "pattern")
    )
    hint = "point at the cloth for its value; click a piece to single it out; drag to turn, shift-drag to move, ctrl-wheel to zoom"
    scale = f'<span id="low">0</span> <i style="background:linear-gradient(90deg,{Scale(high=1.0).css()})"></i> '
    scale += f'<span id="high">{packed["scale"]:.3g} J/m²</span>'
    if packed["scale"] <= SMALLEST_SCALE:
        scale = "No strain energy: the cloth lies flat without strain"
    maps = "".join(
        f'<option value="{key}">{words}</option>'
        for key, words in (
            ("energy", "strain energy"),
            ("warp", "strain along the warp"),
            ("weft", "strain along the weft"),
            *((key, _MAPS[key] + _STATES.get(each["state"], "")) for key, each in packed["maps"].items()),
        )
    )
    speeds = "".join(
        f'<option value="{x:g}"{" selected" if x == 1 else ""}>{x:g} x</option>' for x in (0.25, 0.5, 1, 2)
    )
    body = '<label><input id="body" type="checkbox" checked> body</label>'
    body = body if any(still["kind"] == "body" for still in packed["still"]) else ""
    return (
        f'<div class="stage"><canvas id="view" role="img" tabindex="0" aria-label="the cloth in space and its pattern, '
        f'coloured by strain; the tables below have the numbers"></canvas><div class="bar"><button id="play">Play</button>'
        f'<input id="slider" type="range" min="0" value="0" aria-label="frame">'
        f'<label>speed <select id="speed">{speeds}</select></label><label><input id="loop" type="checkbox"> loop</label>'
        f'<label>map <select id="map">{maps}</select></label>{body}{buttons}</div>'
        f'<div class="scale">{scale}<span id="value" aria-live="polite"></span></div>'
        f'<div class="scale"><span id="label"></span>{hint}</div></div>'
        f'<script id="film" type="application/json">{data}</script>'
    )


def _cards(metrics: Mapping[str, Any]) -> str:
    """Return what one looks for first as HTML: energy, errors, cloth, pieces and fabric."""
    pieces = metrics["pieces"].values()
    area, count = sum(piece["area_m2"] for piece in pieces), count_pieces(metrics)
    fits = [piece["wear"] for piece in pieces if piece.get("wear")]
    stretch = max((each[f"strain_{way}"]["p95"] for each in fits for way in ("warp", "weft")), default=0.0)
    if stretch > STRETCHED and metrics.get("verdict", {}).get("fits"):
        # Cloth that is meant to stretch differs from the body by that, which is no error.
        limit = max(each["strain_limit"] for each in fits)
        differs = [(f"{100 * stretch:.0f} % of {100 * limit:.0f} %", "stretch when worn, of what the cloth allows")]
        if stretch > limit:
            # Of a band that is cut to be stretched so far.
            differs = [(f"{100 * stretch:.0f} %", "largest stretch when worn")]
    else:
        differs = [
            (f"{100 * max(piece['length_error'] for piece in pieces):.2g} %", "largest length error"),
            (f"{100 * max(piece['area_error'] for piece in pieces):.2g} %", "largest area error"),
        ]
    cards = [
        (energy_words(sum(piece["strain_energy_j"] for piece in pieces)), "strain energy"),
        *differs,
        (f"{area:.3g} m²", "laid out"),
        (str(count), "pattern piece" if count == 1 else "pattern pieces"),
        (", ".join(sorted({piece["fabric"] for piece in pieces})), "fabric"),
    ]
    if metrics.get("seams"):
        worst = max(abs(seam["difference_mm"]) for seam in metrics["seams"])
        cards.insert(3, (f"{worst:.2f} mm", "largest seam difference"))
    boxes = "".join(f'<div class="card"><b>{escape(value)}</b><span>{what}</span></div>' for value, what in cards)
    return f'<div class="cards">{boxes}</div>'


def verdict_words(metrics: Mapping[str, Any]) -> str:
    """Return the verdict as HTML: done or not, whether it fits and why not, and what a maker should know."""
    faults = list(dict.fromkeys([*faults_of(metrics), *metrics.get("left_out", ())]))
    lines = [("bad", f"Not done: {_typeset(fault)}.") for fault in faults]
    verdict = metrics.get("verdict")
    findings = verdict["findings"] if verdict else []
    if verdict:
        words = verdict["words"]
        lines.append(("good" if verdict["fits"] else "bad", f"{words[0].upper()}{words[1:]}."))
    if not faults:
        lines.append(("good", "At rest, no flipped faces, no overlap."))
    if metrics.get("rings") and not any(finding["kind"] == "opening" for finding in findings):
        lines.append(("good", "It can be put on: every edge and level passes what of the body goes through it."))
    html = "".join(f'<p class="verdict {kind}">{words}</p>' for kind, words in lines)
    for title, fails in (("Why it does not fit", True), ("To know", False)):
        items = [
            f"<li>{_typeset(finding['words'])}{_typeset('; ' + finding['remedy']) if finding['remedy'] else ''}</li>"
            for finding in findings
            if finding["fails"] is fails
        ]
        html += f"<p><b>{title}</b></p><ul>{''.join(items)}</ul>" if items else ""
    return html


def _thumbnail(words: str, source: str) -> str:
    """Return a picture that is shown small, and whole after a click on it; `words` is HTML."""
    return f'<label class="thumbnail"><input type="checkbox"><img alt="{words}" src="{source}"></label>'


def _typeset(words: str) -> str:
    """Return the HTML of words from the console, which keeps to ASCII: with squares, and no number parted from its unit."""
    squared = re.sub(r"\b([mc]?m)2\b", r"\1²", words)
    return re.sub(r"(?<=\d) (?=(?:%|[mc]?m|[mc]?m²|Pa|m?J)(?!\w))", "&nbsp;", escape(squared))


def ease_table(metrics: Mapping[str, Any]) -> str:
    """Return the girths of body and pattern; empty where it goes around no body."""
    rows = [
        (
            level,
            f"{100 * girth['body_m']:.1f} cm",
            f"{100 * girth['pattern_m']:.1f} cm",
            f"{100 * girth['ease_m']:+.1f} cm",
            f"{100 * girth['ease_wanted_m']:+.1f} cm" if "ease_wanted_m" in girth else "",
        )
        for level, girth in (metrics.get("girths") or {}).items()
    ]
    told = "<p>With darts and seams closed; at a cuff or a band that draws the garment in, around that.</p>"
    return _table(("level", "body", "pattern", "ease", "asked for"), rows) + (told if rows else "")


def _bytes(path: Path) -> bytes:
    with open_file(path, most=_MOST_BYTES) as stream:
        return stream.read()


def _data(file: str) -> str:
    return resources.files("warpflat.app.review").joinpath("data", file).read_text(encoding="utf-8")


Metrics = Mapping[str, Any]


def energy_table(metrics: Metrics) -> str:
    """Return the energies at the end of every stage, with the change since the first relaxation."""
    rows = []
    for name, piece in metrics["pieces"].items():
        whole = next((stage["strain_energy_j"] for stage in piece["stages"] if stage["name"] == "relax"), 0.0)
        for stage in piece["stages"]:
            energy = stage["strain_energy_j"]
            after = stage["name"] not in ("develop", "steps", "relax") and whole > 0.0
            rows.append(
                (
                    name,
                    stage["name"],
                    energy_words(energy),
                    f"{100 * (energy / whole - 1.0):+.1f} %" if after else "",
                    energy_words(stage["model_energy_j"]),
                    f"{stage['steps']:,}",
                    f"{stage['seconds']:.2f} s",
                    "" if stage["name"] == "develop" else "yes" if stage["converged"] else "NO",
                )
            )
    head = ("piece", "stage", "strain energy", "since whole", "model energy", "steps", "time", "at rest")
    return _table(head, rows, text=2)


def ledger_table(metrics: Metrics) -> str:
    """Return every cut with what it opens; empty if there is none."""
    rows = []
    for name, piece in metrics["pieces"].items():
        for cut in piece.get("cuts", ()):
            for seam in cut["seams"]:
                angle = f"{seam['angle_deg']:.1f}°" if "angle_deg" in seam else ""
                legs = " / ".join(f"{1e3 * leg:.1f}" for leg in (seam["left_seam_m"], seam["right_seam_m"]))
                rows.append((name, cut["name"], seam["kind"], f"{1e3 * seam['opening_m']:.1f} mm", angle, f"{legs} mm"))
    return _table(("piece", "cut", "kind", "opening", "angle", "sides"), rows, text=3)


def seam_table(metrics: Metrics) -> str:
    """Return every seam with its two lengths; empty if there is none."""
    rows = [(seam["name"], " = ".join(seam["sides"]), *seam_figures(seam)) for seam in metrics.get("seams") or ()]
    told = "<p>As they are cut: a seam that ends at a cuff or a band is without it.</p>"
    return _table(("seam", "sides", "first", "second", "ease", "difference"), rows, text=2) + (told if rows else "")


def size_table(metrics: Metrics) -> str:
    """Return heights and girths of the mannequin; empty if there is none."""
    levels = (metrics.get("mannequin") or {}).get("levels") or {}
    rows = [
        (name, f"{100 * level['height_m']:.1f} cm", f"{100 * level['girth_m']:.1f} cm")
        for name, level in levels.items()
    ]
    return _table(("level", "height", "girth"), rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], *, text: int = 1) -> str:
    """Return a table whose first `text` columns are words; empty without rows."""
    if not rows:
        return ""

    def line(cells: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}{' class=text' if column < text else ''}>{escape(cell)}</{tag}>"
            for column, cell in enumerate(cells)
        )

    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{line(head, "th")}</tr>{body}</table></div>'
