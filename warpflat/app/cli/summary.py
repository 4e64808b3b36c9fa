"""The short report of a run: at most five lines; `-v` prints the tables instead."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from warpflat.app.cli.options import files_line
from warpflat.app.cli.tables import cut_words
from warpflat.app.review.figures import count_pieces
from warpflat.core import energy_words, format_count, list_some
from warpflat.garment import LACKING, NO_PATTERN

__all__ = ["notes_line", "summary_lines"]

# Letters in the line of notes, at most.
_NOTES_WIDTH = 100
# What a reader opens first.
_OPENED_FIRST = ("review.html", "pattern.pdf", "picture.png", "metrics.json")
# A measurement that was completed from others.
_COMPLETED = re.compile(r"\w+ = [\d.]+ c?m (?!instead of )")


def summary_lines(
    metrics: Mapping[str, Any], files: Sequence[str], folder: str, *, size: str = "", width: int | None = None
) -> list[str]:
    """Return the lines at the end of a run: whether it fits, what helps or is told, what it is, what to print, and the folder.

    Args:
        metrics: as `metrics.json`.
        files: their names.
        folder: where they lie.
        size: of what was read, in words.
        width: letters in a line at most, unless the folder's name is longer; None never cuts a line.
    """
    pieces, verdict, lines = metrics["pieces"], metrics.get("verdict"), list[str]()
    unfinished = [name for name, piece in pieces.items() if not piece["stages"][-1]["converged"]]
    flips = sum(piece["flipped_faces"] for piece in pieces.values())
    wrong = [f"NOT at rest: {list_some(unfinished, 3)}"] if unfinished else []
    wrong += [format_count(flips, "flipped face")] if flips else []
    findings = verdict["findings"] if verdict else []
    failing, told = ([each for each in findings if each["fails"] is fails] for fails in (True, False))
    openings = [each["words"] for each in told if each["kind"] == "opening"]
    if wrong:
        lines.append("; ".join(wrong))
    if verdict:
        more = f" (and {len(failing) - 1} more)" if len(failing) > 1 else ""
        reason = f": {failing[0]['words']}{more}" if failing else ""
        lines.append(f"{verdict['words']}{reason}")
    # What would help where it does not fit, else what a maker should know.
    others = [each["words"] for each in told if each["kind"] != "opening"]
    if taken := metrics.get("pattern_of_file"):
        others.insert(0, cut_words(taken))
    if correction := metrics.get("drape", {}).get("correction"):
        misfits = [1e3 * each["misfit_m"] for each in correction["rounds"]]
        rounds = format_count(len(misfits) - 1, "round")
        change = f"misfit {misfits[0]:.2f} to {misfits[-1]:.2f} mm in {rounds}"
        others.insert(0, f"corrected: {change}; {correction['reason']}")
    if failing and failing[0]["remedy"]:
        # One piece of a mesh for which no seams were looked for.
        alone = size and len(pieces) == 1 and "garment" not in metrics
        if alone and next(iter(pieces.values()))["wear"]["outside"] > NO_PATTERN:
            failing[0] = {
                **failing[0],
                "remedy": 'if it may be parted: --seams auto (find = "auto" in [seams]) looks for seams and darts',
            }
        lines.append(f"  {failing[0]['remedy']}")
    elif others:
        lines.append(f"  {'; '.join(others)}")
    cloth = ", ".join(dict.fromkeys(piece["fabric"] for piece in pieces.values()))
    area = sum(piece["area_m2"] for piece in pieces.values())
    energy = energy_words(sum(piece["strain_energy_j"] for piece in pieces.values()))
    count = format_count(count_pieces(metrics), "pattern piece")
    what = [f"{count}, {area:.3g} m2 laid out in {cloth}, strain energy {energy}"] if pieces else []
    what += [size] if size else []
    what += openings or (["it goes on without a further opening"] if metrics.get("rings") else [])
    lines.append("; ".join(what))
    if metrics.get("garment", {}).get("no_pattern"):
        lines.append("no pattern yet")
    elif "pattern.pdf" in files:
        lines.append(f"print {shlex.quote(f'{folder}/pattern.pdf')}")
    ordered = sorted(files, key=lambda name: _OPENED_FIRST.index(name) if name in _OPENED_FIRST else len(_OPENED_FIRST))
    # A long line is cut after a word that leaves room for dots.
    lines = [
        line if width is None or len(line) <= width else line[: width - 3].rpartition(" ")[0].rstrip(",;(") + " ..."
        for line in lines
        if line
    ]
    # As many names as fit into a line, at least one, and how many more there are.
    listed = files_line(folder, ["no files"])
    for shown in range(len(ordered), 0, -1):
        more = "" if shown == len(ordered) else f", {len(ordered) - shown} more"
        listed = files_line(folder, ordered[:shown]) + more
        if width is None or len(listed) <= width:
            break
    return [*lines, listed]


def notes_line(notes: Sequence[str]) -> str:
    """Return notes as one line: completed measurements are counted, and as many others follow as fit; nothing without any."""
    guessed = [note for note in notes if _COMPLETED.match(note)]
    parts = [f"{format_count(len(guessed), 'measurement')} guessed from others"] if guessed else []
    others = [note for note in notes if note not in guessed]
    # What became of the user's files comes first, then what a pattern lacks.
    first = [note for begin in ("removed", LACKING) for note in others if note.startswith(begin)]
    parts = [*first, *parts, *(note for note in others if note not in first)]
    for count in range(len(parts), 0, -1):
        more = [f"{len(parts) - count} more"] if count < len(parts) else []
        line = "; ".join([*parts[:count], *more, *(["-v lists them"] if more or guessed else [])])
        if len(line) <= _NOTES_WIDTH - len("warpflat: note: "):
            return f"note: {line}"
    rest = f"; {len(parts) - 1} more" if len(parts) > 1 else ""
    return f"note: {parts[0]}{rest}" + ("; -v lists them" if rest else "") if parts else ""
