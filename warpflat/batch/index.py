"""`index.csv` and `index.html`: a row for each task of a batch."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path

from warpflat.batch.plan import Task
from warpflat.batch.task import AT_REST, ERROR, NOT_AT_REST, SET_ASIDE, TO_DO, Row
from warpflat.core.atomic_files import atomic_path

__all__ = ["BatchIndex"]

# The files are written again at most so often while tasks come in [s].
_EVERY = 2.0
_FITS = {None: "", True: "yes", False: "no"}
_COLOURS = {AT_REST: "good", NOT_AT_REST: "bad", ERROR: "bad", SET_ASIDE: "bad"}
_STYLE = """
main { max-width: none; } td, th { vertical-align: middle; } th { cursor: pointer; user-select: none; }
th:hover { color: var(--ink); } th[aria-sort=ascending]::after { content: " ↑"; } th[aria-sort=descending]::after { content: " ↓"; }
td img { height: 90px; width: auto; margin: 0; border-radius: 4px; } td.message { white-space: normal; min-width: 240px; max-width: 420px; }
"""


class BatchIndex:
    """The rows of a batch, in the order of its tasks, and the files that show them."""

    def __init__(self, out: Path, tasks: Sequence[Task]) -> None:
        """Begin with all tasks to do."""
        self._out = out
        self._rows = {task.key: Row(task=task) for task in tasks}
        self._written = -float("inf")

    @property
    def rows(self) -> list[Row]:
        """A row for each task."""
        return list(self._rows.values())

    def add(self, row: Row) -> None:
        """Replace the row of a task."""
        self._rows[row.task.key] = row

    def write_if_due(self) -> None:
        """Write the files if they have not been written for a while."""
        if time.monotonic() - self._written >= _EVERY:
            self.write()

    def write(self) -> None:
        """Write `index.csv` and `index.html`.

        Raises:
            InputError: they cannot be written.
        """
        rows = self.rows
        for name, text in (("index.csv", _table(rows)), ("index.html", _page(rows))):
            with atomic_path(self._out / name) as temporary:
                temporary.write_text(text, encoding="utf-8", newline="")
        self._written = time.monotonic()


def _levels(rows: Sequence[Row]) -> list[str]:
    """Return the levels of all girths, in their first order."""
    return list(dict.fromkeys(level for row in rows for level in row.girths_m))


def _table(rows: Sequence[Row]) -> str:
    levels, text = _levels(rows), io.StringIO()
    writer = csv.writer(text)
    head = ["key", "status", "scene", "body", "fabric", "override", "strain_energy_j", "fits"]
    writer.writerow([*head, *(f"{level}_m" for level in levels), "seconds", "memory_mb", "message"])
    for row in rows:
        task = row.task
        writer.writerow(
            [
                *(task.key, row.status, task.scene, task.body, task.fabric, task.override),
                *(row.strain_energy_j, _FITS[row.fits], *(row.girths_m.get(level) for level in levels)),
                *(row.seconds, row.memory_mb, row.message),
            ]
        )
    return text.getvalue()


def _page(rows: Sequence[Row]) -> str:
    levels = _levels(rows)
    head = ["", "scene", "body", "fabric", "override", "status", "strain energy [mJ]", "fits"]
    head += [*(f"{level} [cm]" for level in levels), "time [s]", "message"]
    counts = {status: sum(row.status == status for row in rows) for status in (AT_REST, *_COLOURS, TO_DO)}
    told = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    style = resources.files("warpflat.review").joinpath("data", "page.css").read_text(encoding="utf-8")
    script = resources.files("warpflat.batch").joinpath("data", "sort.js").read_text(encoding="utf-8")
    cells = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "\n".join(_html_row(row, levels) for row in rows)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>warpflat batch</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}{_STYLE}</style></head>'
        f'<body><main><h1>Batch</h1><p class="sub">{len(rows)} tasks: {escape(told)}. '
        "Girths are of the pattern. A click on a heading sorts.</p>"
        f'<div class="scroll"><table><thead><tr>{cells}</tr></thead><tbody>\n{body}\n</tbody></table></div></main>'
        f"<script>{script}</script></body></html>\n"
    )


def _html_row(row: Row, levels: Sequence[str]) -> str:
    task, key = row.task, row.task.key
    target = f"{key}/review.html" if "review.html" in row.files else f"{key}/"
    picture = f'<img loading="lazy" alt="{key}" src="{key}/picture.png">' if "picture.png" in row.files else key
    first = f'<a href="{target}">{picture}</a>' if row.files else key
    words = [_text(word) for word in (task.scene, task.body, task.fabric, task.override)]
    status = f'<td class="text {_COLOURS.get(row.status, "")}" data-value="{row.status}">{row.status}</td>'
    energy = _number(None if row.strain_energy_j is None else 1e3 * row.strain_energy_j, ".4g")
    girths = [_number(None if level not in row.girths_m else 100 * row.girths_m[level], ".1f") for level in levels]
    message = f'<td class="text message" data-value="{escape(row.message)}">{escape(row.message)}</td>'
    cells = [*words, status, energy, _text(_FITS[row.fits]), *girths, _number(row.seconds, ".1f"), message]
    return f'<tr><td data-value="{key}">{first}</td>{"".join(cells)}</tr>'


def _text(word: str) -> str:
    return f'<td class="text" data-value="{escape(word)}">{escape(word)}</td>'


def _number(value: float | None, form: str) -> str:
    return '<td data-value=""></td>' if value is None else f'<td data-value="{value!r}">{value:{form}}</td>'
