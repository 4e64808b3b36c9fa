"""`index.csv` and `index.html`: a row for each task of a batch."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path

from warpflat._version import __version__
from warpflat.app.batch.plan import Task
from warpflat.app.batch.task import DONE, ERROR, SET_ASIDE, TO_DO, WITH_FAULTS, Row
from warpflat.pattern import atomic_path, output_folder, write_report

__all__ = ["BatchIndex"]

# The files are written again at most so often while tasks come in [s].
_EVERY = 2.0
_FITS = {None: "", True: "yes", False: "no"}
_NAMES = ("scene", "body", "fabric", "override")
_COLOURS = {DONE: "good", WITH_FAULTS: "bad", ERROR: "bad", SET_ASIDE: "bad"}
_STYLE = """
main { max-width: none; } td, th { vertical-align: middle; } th { cursor: pointer; user-select: none; }
th.text { text-align: left; } th:hover { color: var(--ink); } th[aria-sort=ascending]::after { content: " ↑"; }
th[aria-sort=descending]::after { content: " ↓"; }
td img { height: 96px; width: 128px; max-width: none; object-fit: cover; object-position: top; margin: 0; border-radius: 4px; }
td.message { white-space: normal; min-width: 240px; max-width: 420px; }
"""


_BODIES = """
<h2>Bodies</h2><p class="sub">Measures of the patterns over the girths of the bodies, and the ease at each level where a body wears the
nearest size of this batch. <a href="bodies.csv">bodies.csv</a> has the figures.</p>
<img src="bodies.png" alt="Measures of the patterns over bust, waist and hip">"""


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

    def write(self, *, bodies: bool = False) -> None:
        """Write `index.csv`, `index.html` and `batch.json`, all of them or none; the page shows `bodies.png` if that is there.

        Raises:
            InputError: they cannot be written.
        """
        rows = self.rows
        levels = list(dict.fromkeys(level for row in rows for level in row.girths_m))
        table = io.StringIO()
        writer = csv.writer(table)
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
        statuses = [f'<span class="{_COLOURS.get(row.status, "")}">{row.status}</span>' for row in rows]
        pictures = []
        for row in rows:
            key, target = row.task.key, "review.html" if "review.html" in row.files else ""
            shown = f'<img loading="lazy" alt="{key}" src="{key}/picture.png">' if "picture.png" in row.files else key
            pictures.append(f'<a href="{key}/{target}">{shown}</a>' if row.files else key)
        columns = [
            _column("", [row.task.key for row in rows], pictures),
            *(_column(name, [str(getattr(row.task, name)) for row in rows]) for name in _NAMES),
            _column("status", [row.status for row in rows], statuses),
            _numbers("strain energy [mJ]", [row.strain_energy_j for row in rows], 1e3, ".4g"),
            _column("fits", [_FITS[row.fits] for row in rows]),
            *(_numbers(f"{level} [cm]", [row.girths_m.get(level) for row in rows], 100.0, ".1f") for level in levels),
            _numbers("time [s]", [row.seconds for row in rows], 1.0, ".1f"),
            _column("message", [row.message for row in rows]),
        ]
        headings, *body_rows = zip(*filter(None, columns), strict=True)
        body = "\n".join(f"<tr>{''.join(cells)}</tr>" for cells in body_rows)
        counts = {status: sum(row.status == status for row in rows) for status in (*_COLOURS, TO_DO)}
        totals = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
        style = resources.files("warpflat.app.review").joinpath("data", "page.css").read_text(encoding="utf-8")
        script = resources.files("warpflat.app.batch").joinpath("data", "sort.js").read_text(encoding="utf-8")
        texts = {
            "index.csv": table.getvalue(),
            "index.html": (
                '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>warpflat batch</title>'
                f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}{_STYLE}</style></head>'
                f'<body><main><h1>Batch</h1><p class="sub">{len(rows)} tasks: {escape(totals)}. '
                "Girths are of the pattern. A click on a heading sorts.</p>"
                f'<div class="scroll"><table><thead><tr>{"".join(headings)}</tr></thead><tbody>\n{body}\n</tbody></table></div>'
                f"{_BODIES if bodies else ''}</main>"
                f"<script>{script}</script></body></html>\n"
            ),
        }
        with output_folder(self._out, [*texts, "batch.json"], guard=True) as folder:
            for name, text in texts.items():
                with atomic_path(folder / name) as temporary:
                    temporary.write_text(text, encoding="utf-8", newline="")
            files = [*texts, *(["bodies.csv", "bodies.png"] if bodies else [])]
            write_report(folder / "batch.json", {"warpflat": __version__}, name="batch", files=files)
        self._written = time.monotonic()


def _column(name: str, values: Sequence[str], shown: Sequence[str] | None = None) -> list[str]:
    """Return the heading and the cells of a column of text; nothing if no cell says anything."""
    if not any(values):
        return []
    cells = zip(values, shown or [escape(value) for value in values], strict=True)
    kind = f"text {name}".strip()
    return [
        f'<th class="text">{name}</th>',
        *(f'<td class="{kind}" data-value="{escape(value)}">{text}</td>' for value, text in cells),
    ]


def _numbers(name: str, values: Sequence[float | None], unit: float, form: str) -> list[str]:
    """Return the heading and the cells of a column of numbers; nothing if there is none."""
    if all(value is None for value in values):
        return []
    cells = ['data-value="">' if value is None else f'data-value="{value!r}">{unit * value:{form}}' for value in values]
    return [f"<th>{escape(name)}</th>", *(f"<td {cell}</td>" for cell in cells)]
