"""`review.html`: one file with which a run is reviewed, offline: film, numbers, seams, darts and pictures."""

from __future__ import annotations

import base64
import io
import json
import os
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from warpflat.core.activity import report_activity
from warpflat.core.atomic_files import atomic_path, latest_file
from warpflat.core.errors import InputError
from warpflat.core.memory_limit import is_out_of_memory
from warpflat.core.own_files import open_result, read_result, recorded_files
from warpflat.export.colours import SMALLEST_SCALE
from warpflat.review.film import open_film, pack_film
from warpflat.review.tables import energy_table, ledger_table, piece_table, seam_table, size_table, summary_cards

__all__ = ["pack_frames", "pack_pictures", "read_run", "reading_members", "review_folder", "write_review"]

# Nothing on the page may ask for anything from elsewhere, nor from the disk.
_POLICY = "default-src 'none'; img-src data:; script-src 'unsafe-inline'; style-src 'unsafe-inline'"
# Pictures come in this order, and others after them.
_FIRST = ("picture.png", "drape.png", "wear.png", "walked.png")
_QUALITY = 85  # of JPEG
_PNG = b"\x89PNG\r\n\x1a\n"
# The largest picture, which takes 3 bytes of memory for each pixel, and the largest file that the page holds.
_MOST_PIXELS = 150_000_000
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
        open_result(folder / file).close()
    return metrics, listed, name


@contextmanager
def reading_members(folder: Path) -> Iterator[None]:
    """Guard the reading of the files of a run, which others may have changed in any way.

    Raises:
        InputError: whatever goes wrong in the block.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if is_out_of_memory(error) or getattr(error, "errno", None) is not None:  # Pillow's own errors have no number
            raise
        words = f"{type(error).__name__} {error}".strip()
        raise InputError(f"{folder}: a file of the run is damaged ({words[:200]}); run the scene again") from error


def review_folder(folder: str | Path) -> Path:
    """Write `review.html` into the folder of an earlier run; return its path.

    Raises:
        InputError: the folder holds no run, a file of it cannot be read, or the page cannot be written.
    """
    from warpflat.core.atomic_files import output_folder
    from warpflat.core.manifest import record_file

    folder = Path(folder)
    metrics, files, name = read_run(folder)
    with output_folder(folder, ["review.html"], guard=True):
        write_review(folder, metrics, files, name=name)
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
    return {file: _image(latest_file(folder / file)) for file in files if _is_shown(file)}


def write_review(
    folder: Path,
    metrics: Mapping[str, Any],
    files: Sequence[str],
    *,
    name: str,
    film: Callable[[], Mapping[str, Any] | None] | None = None,
    pictures: Mapping[str, str] | None = None,
) -> str:
    """Write `review.html` and return its name.

    Args:
        folder: of the run.
        metrics: as `metrics.json`.
        files: what the run has written, by name.
        name: of the run.
        film: gives what `pack_frames` has made of this folder, if it was called before.
        pictures: of :func:`pack_pictures`, those that were packed before.

    Raises:
        InputError: a file cannot be read as what it is, or the page cannot be written.
    """
    report_activity("writing the review page")
    path = folder / "review.html"
    with reading_members(folder):
        page = _page(folder, metrics, files, name, film or (lambda: pack_frames(folder)), pictures or {})
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path.name


def _page(
    folder: Path,
    metrics: Mapping[str, Any],
    files: Sequence[str],
    name: str,
    packed_film: Callable[[], Mapping[str, Any] | None],
    pictures: Mapping[str, str],
) -> str:
    film, packed = "", None
    if "frames.usdc" in files:
        packed = packed_film()
        film = (
            _film_section(packed)
            if packed
            else "<p>The film is too large for a page, or could not be packed; see frames.usdc.</p>"
        )
    notes = [(f"{piece}: {note}") for piece, entry in metrics["pieces"].items() for note in entry.get("notes", ())]
    sections = [
        ("", summary_cards(metrics)),
        ("From the development to rest", film),
        ("Worn: from the designed surface to rest", _worn(folder, files)),
        ("Pictures", _pictures(folder, files, pictures)),
        ("Pattern", _drawings(folder, files)),
        ("Cuts and darts", ledger_table(metrics)),
        ("Seams", seam_table(metrics)),
        ("Pieces", piece_table(metrics)),
        ("Energy, stage by stage", energy_table(metrics)),
        ("Body", size_table(metrics)),
        ("Notes", "<ul>" + "".join(f"<li>{escape(note)}</li>" for note in notes) + "</ul>" if notes else ""),
        ("Files", "<ul>" + "".join(f"<li>{escape(file)}</li>" for file in sorted(files)) + "</ul>"),
    ]
    body = "".join(f"<h2>{title}</h2>{content}" if title else content for title, content in sections if content)
    script = f"<script>{_data('viewer.js')}</script>" if packed else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(name)} - review</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_data("page.css")}</style></head>'
        f'<body><main><h1>{escape(name)}</h1><p class="sub">warpflat {escape(str(metrics["warpflat"]))}</p>'
        f"{body}</main>{script}</body></html>\n"
    )


def _film_section(film: Mapping[str, Any]) -> str:
    """Return the viewer with its film."""
    # No text of a film may end the script it stands in.
    data = json.dumps(film, separators=(",", ":")).replace("<", "\\u003c")
    buttons = "".join(
        f'<button data-view="{view}">{view.capitalize()}</button>'
        for view in ("all", "front", "side", "back", "pattern")
    )
    colours = base64.b64decode(film["colours"])
    stops = ",".join(f"rgb({colours[i]},{colours[i + 1]},{colours[i + 2]})" for i in range(0, len(colours), 3 * 15))
    hint = "drag to turn, shift-drag to move, wheel to zoom"
    scale = (
        f'0 <i style="background:linear-gradient(90deg,{stops})"></i> {film["scale"]:.3g} J/m² strain energy density · '
    )
    if film["scale"] <= SMALLEST_SCALE:
        scale = "No strain energy: the cloth lies flat without strain · "
    return (
        f'<div class="stage"><canvas id="view"></canvas><div class="bar"><button id="play">Play</button>'
        f'<input id="slider" type="range" min="0" value="0" aria-label="frame"><span id="label"></span>{buttons}</div>'
        f'<div class="scale">{scale}{hint}</div></div>'
        f'<script id="film" type="application/json">{data}</script>'
    )


def _is_shown(file: str) -> bool:
    return file.endswith(".png") and file != "contact_sheet.png"


def _pictures(folder: Path, files: Sequence[str], packed: Mapping[str, str]) -> str:
    shown = {**pack_pictures(folder, [file for file in files if file not in packed]), **packed}
    order = sorted(shown, key=lambda file: (_FIRST.index(file) if file in _FIRST else len(_FIRST), file))
    return "".join(f'<img alt="{escape(file)}" src="{shown[file]}">' for file in order)


def _worn(folder: Path, files: Sequence[str]) -> str:
    """Return the moving picture of the drape."""
    if "drape.webp" not in files:
        return ""
    text = base64.b64encode(_bytes(latest_file(folder / "drape.webp"))).decode("ascii")
    return (
        f'<img alt="drape.webp" src="data:image/webp;base64,{text}"><p>Front, left side and back, coloured by the gap to the body; '
        "frames.usdc holds the same in space.</p>"
    )


def _drawings(folder: Path, files: Sequence[str]) -> str:
    found = sorted(file for file in files if file.endswith(".svg"))
    parts = []
    for file in found:
        text = base64.b64encode(_bytes(latest_file(folder / file))).decode("ascii")
        parts.append(f'<img class="drawing" alt="{escape(file)}" src="data:image/svg+xml;base64,{text}">')
    return "".join(parts)


def _image(path: Path) -> str:
    """Return a picture as text: as JPEG where that is smaller."""
    from PIL import Image

    best, kind, small = _bytes(path), "png", io.BytesIO()
    # No other format is tried, some of which start a program; and the size is known before a pixel is decoded.
    wide, high = struct.unpack(">II", best[16:24]) if best[:8] == _PNG and len(best) >= 24 else (0, 0)
    if not 0 < wide * high <= _MOST_PIXELS:
        raise InputError(f"{path}: is no PNG of at most {_MOST_PIXELS:,} pixels; run the scene again")
    with Image.open(io.BytesIO(best), formats=["PNG"]) as picture:
        if max(picture.size) < 65_000:
            # WebP has half the bytes, and takes ten times as long.
            picture.convert("RGB").save(small, "JPEG", quality=_QUALITY)
            if len(small.getvalue()) < len(best):
                best, kind = small.getvalue(), "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(best).decode('ascii')}"


def _bytes(path: Path) -> bytes:
    with open_result(path, most=_MOST_BYTES) as stream:
        return stream.read()


def _data(file: str) -> str:
    return resources.files("warpflat.review").joinpath("data", file).read_text(encoding="utf-8")
