"""The tables of the review page, from the numbers in `metrics.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from warpflat.core.text import energy_words

__all__ = ["energy_table", "ledger_table", "piece_table", "seam_table", "size_table", "summary_cards"]

Metrics = Mapping[str, Any]


def summary_cards(metrics: Metrics) -> str:
    """Return the verdict and the numbers that a reviewer looks at first."""
    pieces = metrics["pieces"].values()
    flips = sum(piece["flipped_faces"] for piece in pieces)
    unfinished = [name for name, piece in metrics["pieces"].items() if not piece["converged"]]
    overlap = sum(piece.get("overlap_m2", 0.0) for piece in pieces)
    wrong = [
        *([f"not at rest: {', '.join(unfinished)}"] if unfinished else []),
        *([f"{flips} flipped faces"] if flips else []),
        *([f"{1e6 * overlap:.3g} mm² lie over each other"] if overlap else []),
    ]
    verdict = (
        f'<p class="verdict bad">{escape("; ".join(wrong))}</p>'
        if wrong
        else '<p class="verdict good">At rest, no flipped faces, no overlap.</p>'
    )
    area = sum(piece["area_m2"] for piece in pieces)
    cards = [
        (energy_words(sum(piece["strain_energy_j"] for piece in pieces)), "strain energy"),
        (f"{100 * max(piece['length_error'] for piece in pieces):.2g} %", "largest length error"),
        (f"{100 * max(piece['area_error'] for piece in pieces):.2g} %", "largest area error"),
        (f"{area:.3g} m²", "cloth"),
        (str(len(metrics["pieces"])), "piece" if len(metrics["pieces"]) == 1 else "pieces"),
        (", ".join(sorted({piece["fabric"] for piece in pieces})), "fabric"),
    ]
    if metrics.get("seams"):
        worst = max(abs(seam["difference_mm"]) for seam in metrics["seams"])
        cards.insert(3, (f"{worst:.2f} mm", "largest seam difference"))
    boxes = "".join(f'<div class="card"><b>{escape(value)}</b><span>{what}</span></div>' for value, what in cards)
    return f'{verdict}<div class="cards">{boxes}</div>'


def energy_table(metrics: Metrics) -> str:
    """Return the energies at the end of every stage, with the change since the first relaxation."""
    rows = []
    for name, piece in metrics["pieces"].items():
        whole = next((stage["strain_energy_j"] for stage in piece["stages"] if stage["name"] == "relax"), 0.0)
        for stage in piece["stages"]:
            energy = stage["strain_energy_j"]
            after = stage["name"] not in ("develop", "coarse", "steps", "relax") and whole > 0.0
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


def piece_table(metrics: Metrics) -> str:
    """Return size, errors and energy of every piece."""
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
    return _table(head, rows)


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
    rows = [
        (
            seam["name"],
            " + ".join(seam["sides"]),
            f"{seam['length_mm'][0]:.1f} mm",
            f"{seam['length_mm'][1]:.1f} mm",
            f"{seam['difference_mm']:+.3f} mm",
            f"{100 * seam['ease']:.1f} %",
        )
        for seam in metrics.get("seams") or ()
    ]
    return _table(("seam", "edges", "first", "second", "difference", "ease"), rows, text=2)


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
