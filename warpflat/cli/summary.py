"""The short report of a run: a line each for pieces, relaxation, girths, fit, seams, drape, files; `-v` prints the tables instead."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from warpflat.core.text import energy_words, format_count
from warpflat.flattening.fit_report import garment_wear, no_cut_words, remedy_words, wearer_words
from warpflat.flattening.progress import relaxation_words
from warpflat.garment.rings import rings_line
from warpflat.garment.to_pattern import LACKING
from warpflat.scene.found_seams import NO_PATTERN

__all__ = ["cut_words", "notes_line", "summary_lines"]

# Letters in the line of notes, at most.
_NOTES_WIDTH = 100
# What a reader opens first.
_OPENED_FIRST = ("review.html", "pattern.pdf", "picture.png", "metrics.json")
# Girths that every pattern is judged by, whether or not their ease was given.
_MAIN_GIRTHS = ("bust", "waist", "hip")
# A measurement that was completed from others.
_COMPLETED = re.compile(r"\w+ = [\d.]+ c?m (?!instead of )")


def cut_words(taken: Mapping[str, Any]) -> str:
    """Return in words how a pattern that was taken as it is compares with what flattening gives: the entry `pattern_of_file`."""
    return (
        f"as the file's texture has it, in {taken['unit']}, {taken['area_ratio']:.3f} times the area of the worn cloth; flattening lies "
        f"{taken['mean_mm']:.2f} mm from it on average, 95 % within {taken['p95_mm']:.2f} mm"
    )


def summary_lines(
    metrics: Mapping[str, Any], files: Sequence[str], folder: str, *, size: str = "", width: int | None = None
) -> list[str]:
    """Return the lines at the end of a run.

    Args:
        metrics: as `metrics.json`.
        files: their names.
        folder: where they lie.
        size: of what was read, in words.
        width: letters in a line at most, unless the folder's name is longer; None never cuts a line.
    """
    pieces = metrics["pieces"]
    unfinished = [name for name, piece in pieces.items() if not piece["stages"][-1]["converged"]]
    flips = sum(piece["flipped_faces"] for piece in pieces.values())
    parts = [
        f"{sum(piece['vertices'] for piece in pieces.values()):,} vertices",
        "converged" if not unfinished else f"NOT converged: {_some(unfinished)}",
        *([format_count(flips, "flipped face")] if flips else []),
        f"length within {100 * max(piece['length_error'] for piece in pieces.values()):.3g} %",
        f"area within {100 * max(piece['area_error'] for piece in pieces.values()):.3g} %",
        f"energy {energy_words(sum(piece['strain_energy_j'] for piece in pieces.values()))}",
    ]
    lines = [_clipped(f"pieces: {len(pieces)}; {', '.join(parts)}", width)]
    if size:
        lines.append(_clipped(f"size: {size}", width))
    if relaxed := relaxation_words(piece["stages"] for piece in pieces.values()):
        lines.append(f"relaxed: {relaxed}")
    if taken := metrics.get("pattern_of_file"):
        lines.append(_clipped(f"pattern: {cut_words(taken)}", width))
    if girths := metrics.get("girths"):
        # The girths of the pattern, each with the ease that it has, and the one wanted where that is another.
        by_level: dict[str, str] = {}
        for level, girth in girths.items():
            got, wanted = (f"{100 * girth.get(key, girth['ease_m']):+.1f}" for key in ("ease_m", "ease_wanted_m"))
            of = "" if got == wanted else f" of {wanted}"
            by_level[level] = f"{level} {100 * girth['pattern_m']:.1f} ({got}{of})"
        first = [level for level in girths if level in _MAIN_GIRTHS]
        then = [level for level in girths if level not in first and "ease_wanted_m" in girths[level]]
        rest = [level for level in girths if level not in (*first, *then)]
        lines.append(_listed("girths [cm] (ease): ", [by_level[level] for level in (*first, *then, *rest)], width))
    wearer = metrics.get("wear", {}).get("wearer")
    if wearer:
        lines.append(_clipped(wearer_words(wearer, draped="drape" in metrics), width))
    worn = {name: piece for name, piece in pieces.items() if piece.get("wear")}
    if worn:
        head = "lies on the form" if wearer else "lies on the surface" if "drape" in metrics else "fit"
        all_of_it = garment_wear(worn)
        beyond = f"{100 * all_of_it['outside']:.1f} % beyond the limit"
        if all_of_it["fits"]:
            # The strains along both threads, 5 to 95 % of each piece's cloth, and the highest pressure.
            wears, ranges = [piece["wear"] for piece in worn.values()], []
            for thread in ("warp", "weft"):
                low = 100 * min(wear[f"strain_{thread}"]["p05"] for wear in wears)
                high = 100 * max(wear[f"strain_{thread}"]["p95"] for wear in wears)
                ranges.append(f"{thread} {round(low, 1) + 0.0:+.1f} to {round(high, 1) + 0.0:+.1f} %")
            highest = max(wear["pressure"]["max"] for wear in wears)
            ranges += [f"at most {highest:,.0f} Pa"] if highest >= 1.0 else []
            lines.append(_clipped(f"{head}: yes; {beyond}; {', '.join(ranges)}", width))
        else:
            # The worst place, and the best advice for it.
            unfit = [name for name in worn if not worn[name]["wear"]["fits"]]
            worst = max(unfit, key=lambda name: worn[name]["wear"]["outside"] * worn[name]["area_m2"])
            wear = worn[worst]["wear"]
            sewn = "outside_unsewn" in wear
            before = wear["outside_unsewn"] if sewn else wear["outside"]
            # Of cuts that were tried the one that leaves least; those that were not are in the order of their promise.
            best = min(
                wear["would_help"],
                key=lambda r: 1.0 if r["outside_after"] is None else r["outside_after"],
                default=None,
            )
            advice = no_cut_words(before, sewn=sewn) if best is None else remedy_words(best, before, sewn=sewn)
            place = next(iter(wear["where_not"]), "").partition(" (limit")[0]
            lines.append(_clipped(f"{head}: no: {_some(unfit)}; {beyond}; {worst} {place}", width))
            lines.append(_clipped(f"  {advice}", width))
            # One piece of a mesh for which no seams were looked for.
            if size and len(pieces) == 1 and "garment" not in metrics and all_of_it["outside"] > NO_PATTERN:
                lines.append('  if it may be parted: --seams auto (find = "auto" in [seams]) looks for seams and darts')
    seams, constraints = metrics.get("seams", ()), metrics.get("constraints", ())
    if seams or constraints:
        parts = []
        if seams:
            apart = [abs(seam["difference_mm"]) for seam in seams]
            if "garment" in metrics:
                # As drawn, where the borders of a scan are too ragged for smooth curves of the same length.
                apart.append(metrics.get("pattern", {}).get("seam_difference_mm") or 0.0)
            parts.append(f"{len(seams)}, sides equal within {_within(max(apart))}")
        if eased := [f"{seam['name']} {100 * seam['ease']:+.3g} %" for seam in seams if seam["ease"]]:
            parts.append(f"eased: {_some(eased)}")
        if constraints:
            amiss = _within(max(held["amiss_mm"] for held in constraints))
            parts.append(f"{format_count(len(constraints), 'constraint')} within {amiss}")
        lines.append(_clipped(f"seams: {'; '.join(parts)}", width))
    if found := metrics.get("garment", {}).get("found_seams"):
        # Left and right together, the one that releases most first.
        groups: dict[str, list[Mapping[str, Any]]] = {}
        for seam in found:
            groups.setdefault(re.sub(r" (left|right)\b", "", seam["name"]), []).append(seam)
        prices = {name: sum(seam["released_j"] or 0.0 for seam in own) for name, own in groups.items()}
        words = []
        for name in sorted(groups, key=lambda one: -prices[one]):
            tried = any(seam["released_j"] is not None for seam in groups[name])
            price = f" {energy_words(prices[name], 2)}" if tried else f" ({groups[name][0]['needed'] or 'not tried'})"
            words.append(f"{name}{price}, {100 * sum(seam['length_m'] for seam in groups[name]):.0f} cm")
        lines.append(_listed("seams release: ", words, width))
    if metrics.get("rings"):
        lines.append(_clipped(rings_line(metrics["rings"]), width))
    if len(metrics.get("cloths", ())) > 1:
        # What is cut from each of several cloths.
        parts = [
            f"{cloth['name']}: " + ", ".join(f"{piece['title']} {piece['quantity']}" for piece in cloth["pieces"])
            for cloth in metrics["cloths"]
        ]
        lines.append(_clipped(f"cut from {'; '.join(parts)}", width))
    if "drape" in metrics:
        drape = metrics["drape"]
        mean, misfit = 1e3 * drape["distance_m"]["mean"], drape["misfit_m"]
        parts = [
            f"fits: {'yes' if drape['fits'] else 'no'}; worn {mean:.1f} mm from the {drape['compared_with']}",
            f"misfit {1e3 * misfit['mean']:.1f} mm",
            f"at most {1e3 * misfit['max']:.1f} mm",
        ]
        places = [place["words"] for place in drape["places"][:1]]
        lines.append(_clipped(f"drape: {'; '.join([', '.join(parts), *places])}", width))
        if found := drape.get("correction"):
            first, *_, last = (1e3 * each["misfit_m"] for each in found["rounds"])
            rounds = format_count(len(found["rounds"]) - 1, "round")
            lines.append(
                _clipped(f"corrected: misfit {first:.2f} to {last:.2f} mm in {rounds}; {found['reason']}", width)
            )
    ordered = sorted(files, key=lambda name: _OPENED_FIRST.index(name) if name in _OPENED_FIRST else len(_OPENED_FIRST))
    lines.append(_listed(f"files: {folder}: ", ordered, width))
    # In plain words whether it fits, which openings it needs, and what to print or open next. A drape says best whether it fits.
    drape = metrics.get("drape")
    parts = []
    if not all(piece["converged"] for piece in pieces.values()):
        parts.append("not at rest")
    if drape is not None:
        parts.append("fits when worn" if drape["fits"] else "does not fit when worn")
    elif worn:
        fits = all(piece["wear"]["fits"] for piece in worn.values()) and (wearer or {}).get("fits", True)
        parts.append("fits by its strain" if fits else "does not fit by its strain: the cloth is held beyond its limit")
    shut = [
        f"{ring['name']} {ring['opening_needed_mm'] / 10:g} cm"
        for ring in metrics.get("rings", ())
        if ring["passes"] is False
    ]
    parts += [f"needs an opening at {' and '.join(shut)}"] if shut else []
    if metrics.get("garment", {}).get("no_pattern"):
        parts.append("no pattern yet")
    elif "pattern.pdf" in files:
        parts.append(f"print {folder}/pattern.pdf")
    lines.append(_clipped(f"result: {'; '.join(parts) or f'see {folder}'}", width))
    return lines


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


def _within(millimetres: float) -> str:
    return f"{max(millimetres, 0.01):.2f} mm"


def _some(names: Sequence[str]) -> str:
    """Return up to three names, and how many more there are."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def _listed(head: str, parts: Sequence[str], width: int | None) -> str:
    """Return as many parts as fit into a line, at least one, and how many more there are."""
    for count in range(len(parts), 1, -1):
        more = "" if count == len(parts) else f", {len(parts) - count} more"
        line = f"{head}{', '.join(parts[:count])}{more}"
        if width is None or len(line) <= width:
            return line
    return f"{head}{parts[0]}" + (f", {len(parts) - 1} more" if len(parts) > 1 else "")


def _clipped(line: str, width: int | None) -> str:
    """Return a line, a long one cut after a word that leaves room for dots."""
    return line if width is None or len(line) <= width else line[: width - 3].rpartition(" ")[0].rstrip(",;(") + " ..."
