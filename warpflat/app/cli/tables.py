"""The tables and warnings of the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

from warpflat.app.cli.options import files_line
from warpflat.app.review.figures import aligned, relaxation_words, seam_figures
from warpflat.core import energy_words
from warpflat.flat import DEFAULT_FABRIC, GRADES, Fabric, Provenance, value_names

if TYPE_CHECKING:
    from warpflat.flat import Ledger
    from warpflat.garment import Mannequin

__all__ = [
    "drape_lines",
    "edit_table",
    "fabric_data",
    "fabric_sheet",
    "fabric_table",
    "ledger_table",
    "mannequin_table",
    "measures_table",
    "rings_line",
    "run_summary",
]

_UNITS = {
    "areal_density": "kg/m2",
    "stiffness_warp": "N/m",
    "stiffness_weft": "N/m",
    "shear_stiffness": "N/m per rad",
    "shear_limit": "degrees",
    "bending": "N m",
}


def run_summary(metrics: Mapping[str, Any], files: Sequence[str], folder: str) -> str:
    """Return the tables at the end of a run, with the names of its files; :mod:`warpflat.app.cli.summary` has the short report.

    Args:
        metrics: as `metrics.json`.
        files: their names.
        folder: where they lie.
    """
    head = ("piece", "vertices", "length error", "area error", "strain energy", "flips", "converged")
    rows = []
    for name, piece in metrics["pieces"].items():
        rows.append(
            (
                name,
                f"{piece['vertices']:,}",
                f"{100 * piece['length_error']:.3g} %",
                f"{100 * piece['area_error']:.3g} %",
                energy_words(piece["strain_energy_j"]),
                f"{piece['flipped_faces']:,}",
                "yes" if piece["stages"][-1]["converged"] else "NO",
            )
        )
    # Of a pattern that was only draped nothing was flattened.
    tables = [aligned(head, rows)] if rows else []
    if relaxed := relaxation_words(piece["stages"] for piece in metrics["pieces"].values()):
        tables.append(f"relaxed: {relaxed}")
    if metrics.get("seams"):
        columns = ("seam", "sides", "first", "second", "ease", "difference", "price")
        seams = [
            (seam["name"], " = ".join(seam["sides"]), *seam_figures(seam), _price(seam["price_j"]))
            for seam in metrics["seams"]
        ]
        tables.append(aligned(columns, seams, left=(0, 1)))
    if found := metrics.get("garment", {}).get("found_seams"):
        # What closing each seam would cost, per centimetre of the garment as it is worn.
        prices = [
            (
                seam["name"],
                f"{100 * seam['length_m']:.1f} cm",
                _price(seam["released_j"]) or seam["needed"] or "not tried",
                ""
                if seam["released_j"] is None
                else f"{energy_words(seam['released_j'] / max(100 * seam['length_m'], 1e-9))}/cm",
            )
            for seam in found
        ]
        tables.append(aligned(("found seam", "as worn", "releases", "per cm"), prices))
    if metrics.get("constraints"):
        held = [
            (each["name"], f"{each['amiss_mm']:.2f} mm", _price(each["price_j"])) for each in metrics["constraints"]
        ]
        tables.append(aligned(("constraint", "amiss", "price"), held))
    if metrics.get("girths"):
        # Of the pattern with darts and seams closed, the ease got and wanted.
        parts = []
        for level, girth in metrics["girths"].items():
            wanted = f" of {100 * girth['ease_wanted_m']:+.1f}" if "ease_wanted_m" in girth else ""
            parts.append(
                f"{level} {100 * girth['body_m']:.1f} / {100 * girth['form_m']:.1f} / {100 * girth['pattern_m']:.1f} "
                f"({100 * girth['ease_m']:+.1f}{wanted})"
            )
        tables.append(f"girths [cm], body / form / pattern (ease): {'; '.join(parts)}")
    if metrics.get("rings"):
        tables.append(rings_line(metrics["rings"]))
    if len(metrics.get("cloths", ())) > 1:
        # What is cut from each of several cloths.
        parts = [
            f"{cloth['name']}: " + ", ".join(f"{piece['title']} {piece['quantity']}" for piece in cloth["pieces"])
            for cloth in metrics["cloths"]
        ]
        tables.append(f"cut from {'; '.join(parts)}")
    if taken := metrics.get("pattern_of_file"):
        tables.append(f"pattern: {cut_words(taken)}")
    listed = files_line(folder, files)
    return "\n\n".join(tables) + f"\n{listed}" if tables else listed


def rings_line(rings: Sequence[Mapping[str, Any]]) -> str:
    """Return the console's line about the entry `rings` of `metrics.json`."""
    shut = [
        f"{ring['name']} {ring['opening_needed_mm'] / 10:g} cm ({ring['length_mm'] / 10:.1f} < {ring['over']} {ring['girth_mm'] / 10:.1f})"
        for ring in rings
        if ring["passes"] is False
    ]
    unknown = [ring["name"] for ring in rings if ring["passes"] is None]
    parts = [f"need an opening: {', '.join(shut)}"] if shut else []
    parts += [f"not known: {', '.join(unknown)}"] if unknown else []
    return f"rings: {'; '.join(parts) or f'all {len(rings)} pass'}"


def cut_words(taken: Mapping[str, Any]) -> str:
    """Return in words how a pattern that was taken as it is compares with what flattening gives: the entry `pattern_of_file`."""
    return (
        f"as the file's texture has it, in {taken['unit']}, {taken['area_ratio']:.3f} times the area of the worn cloth; flattening lies "
        f"{taken['mean_mm']:.2f} mm from it on average, 95 % within {taken['p95_mm']:.2f} mm"
    )


def _price(joules: float | None) -> str:
    return "" if joules is None else energy_words(joules)


def drape_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Return what a drape has found, a sentence a line; none without one. Places that the verdict tells stand there."""
    if "drape" not in metrics:
        return []
    drape = metrics["drape"]
    misfit, distance = drape["misfit_m"], drape["distance_m"]
    first = (
        f"worn {1e3 * distance['mean']:.2f} mm from the {drape['compared_with']}, "
        f"of which {1e3 * misfit['mean']:.2f} mm is misfit (95 %: {1e3 * misfit['p95']:.1f}, at most {1e3 * misfit['max']:.1f} mm)"
    )
    told = {finding["words"] for finding in metrics["verdict"]["findings"]}
    return [first, *(f"  {place['words']}" for place in drape["places"] if place["words"] not in told)]


def mannequin_table(body: Mannequin) -> str:
    """Return height and girth of every level of a body as text, from the neck down; of a scan beside those of the nearest size."""
    source, levels, difference = body.source, body.levels(), body.size_difference()
    head = ["level", "height", "girth"]
    rows = [[name, f"{100 * level.height:.1f} cm", f"{100 * level.girth:.1f} cm"] for name, level in levels.items()]
    if difference is not None:
        source += f"; nearest size {difference.size}"
        head += ["section", "height over size", "girth over size"]
        for row, (name, level) in zip(rows, levels.items(), strict=True):
            section = "" if level.section is None else f"{100 * level.section:.1f} cm"
            row += [section, _more(difference.heights, name), _more(difference.girths, name)]
    return f"{source}\n{aligned(head, rows)}"


def measures_table(body: Mannequin) -> str:
    """Return the tapes around a scan as text, from the head down, beside those of the nearest size; "" without a scan."""
    difference = body.measure_difference()
    if difference is None:
        return ""
    head = ("tape around the scan", "height", "girth", "height over size", "girth over size", "place")
    rows = [
        (
            name, f"{100 * m.height:.1f} cm", f"{100 * m.girth:.1f} cm", _more(difference.heights, name),
            _more(difference.girths, name), "" if m.guess is None else "guess",
        )
        for name, m in body.measures.items()
    ]  # fmt: skip
    return aligned(head, rows)


def _more(of: Mapping[str, float], name: str) -> str:
    return f"{100 * of[name]:+.1f} cm" if name in of else ""


def ledger_table(ledger: Ledger) -> str:
    """Return the cuts of a ledger as text, best first, with the numbers that `--apply` takes."""
    from warpflat.pattern import candidate_words

    head = (
        "", "cut", "per cm", "released", "left", "length", "opening", "angle", "length error", "area error", "beyond the limit",
        "flips",
    )  # fmt: skip
    rows = [
        (
            str(number),
            entry.name,
            *candidate_words(entry),
            f"{100 * entry.length_error_before:.2f} > {100 * entry.length_error:.2f} %",
            f"{100 * entry.area_error_before:.2f} > {100 * entry.area_error:.2f} %",
            f"{100 * entry.outside_before:.1f} > {100 * entry.outside_after:.1f} %",
            str(entry.flipped_faces),
        )
        for number, entry in enumerate(ledger.entries, start=1)
    ]
    peaks = [f"peak {number}: {place}" for number, place in enumerate(ledger.peaks, start=1)]
    note = "released and left: model energy of the pieces that it changes, relaxed coarsely"
    both = "; both sides of the body are cut" if any(entry.cut for entry in ledger.entries) else ""
    refused = [f"not possible: {name} ({reason})" for name, reason in ledger.refused]
    return "\n".join([*peaks, aligned(head, rows, left=(1,)), f"{note}{both}", *refused])


def edit_table(edit: Mapping[str, Any]) -> str:
    """Return energies, strain and darts of a garment before and after an edit as text."""
    before, after = edit["before"], edit["after"]
    rows = [
        (f"{words} energy", *(energy_words(each[f"{words}_energy_j"]) for each in (before, after)))
        for words in ("strain", "model")
    ]
    rows.append(("beyond the limit", *(f"{100 * each['outside']:.1f} %" for each in (before, after))))
    rows.append(("fits", *("yes" if each["fits"] else "no" for each in (before, after))))
    for name in dict.fromkeys((*before["mouths_m"], *after["mouths_m"])):
        widths = (each["mouths_m"].get(name) for each in (before, after))
        rows.append((name, *("-" if width is None else f"{1e3 * width:.1f} mm" for width in widths)))
    return aligned(("", "before", "after"), rows)


def fabric_table(fabrics: Sequence[Fabric]) -> str:
    """Return the fabrics as text, a line each, with units and grades."""
    head = ("fabric", "kg/m2", "K warp", "K weft", "G [N/m]", "nu", "limit", "shear", "grade", "description")
    rows = []
    used: set[str] = set()
    for fabric in fabrics:
        grades = "".join(sorted({origin.grade for origin in fabric.provenance.values() if origin.grade}))
        used |= set(grades)
        rows.append(
            (
                fabric.name,
                f"{_estimate_sign(fabric, 'areal_density')}{fabric.areal_density:.3f}",
                f"{_estimate_sign(fabric, 'stiffness_warp')}{fabric.stiffness_warp:,.0f}",
                f"{_estimate_sign(fabric, 'stiffness_weft')}{fabric.stiffness_weft:,.0f}",
                f"{_estimate_sign(fabric, 'shear_stiffness')}{fabric.shear_stiffness:,.0f}",
                f"{fabric.poisson_ratio:.2g}",
                f"{100 * fabric.strain_limit:.3g} %",
                "-" if fabric.is_isotropic else f"{_estimate_sign(fabric, 'shear_limit')}{fabric.shear_limit:.3g} deg",
                grades or "-",
                fabric.description,
            )
        )
    also = [f"{alias} is {fabric.name}" for fabric in fabrics for alias in fabric.aliases]
    grades_text = ", ".join(f"{grade} {GRADES[grade]}" for grade in sorted(used))
    notes = [
        "K: secant tensile stiffness [N/m], G: shear stiffness [N/m per rad]; ~ estimate, > lower bound",
        "limit, shear: strain, and angle off the right angle, that a pattern may ask of the cloth",
        f"grades: {grades_text}",
        *([f"also known: {', '.join(also)}"] if also else []),
        f"default: {DEFAULT_FABRIC}; test loads and sources: warpflat fabrics NAME",
    ]
    return "\n".join([aligned(head, rows, left=(0, 9)), "", *notes])


def fabric_sheet(fabric: Fabric) -> str:
    """Return one fabric as text: each value with its unit, test load, grade and source."""
    sources: dict[str, str] = {}
    rows = []
    for key in value_names():
        if getattr(fabric, key) == ():
            continue
        origin = fabric.provenance.get(key, Provenance(source="default"))
        number = sources.setdefault(origin.source, f"[{len(sources) + 1}]")
        given = getattr(fabric, key)
        value = f"{len(given)} points" if key.startswith("curve_") else f"{given:.6g}"
        if origin.at_least:
            value = f">= {value}"
        if origin.spread is not None:
            value += f" ({origin.spread[0]:g} to {origin.spread[1]:g})"
        rows.append((key, value, _UNITS.get(key, ""), origin.test_load or "-", origin.grade or "-", number))
    parts = [f"{fabric.name}: {fabric.description}" if fabric.description else fabric.name]
    if fabric.aliases:
        parts.append(f"also: {', '.join(fabric.aliases)}")
    parts += ["", aligned(("value", "", "unit", "test load", "grade", "source"), rows, left=(0, 2, 3, 4, 5))]
    for key in ("curve_warp", "curve_weft"):
        if points := getattr(fabric, key):
            text = ", ".join(f"{100 * strain:.3g} %: {tension:.3g} N/m" for strain, tension in points)
            parts.append(f"{key}: {text}")
    parts += ["", *(f"{number} {source}" for source, number in sources.items())]
    if grades := sorted({origin.grade for origin in fabric.provenance.values() if origin.grade}):
        parts += ["", f"grades: {', '.join(f'{grade} {GRADES[grade]}' for grade in grades)}"]
    return "\n".join(parts)


def fabric_data(fabric: Fabric) -> dict[str, Any]:
    """Return a fabric as plain data: its values, and the origin of each under `provenance`."""
    data = {field.name: getattr(fabric, field.name) for field in fields(fabric) if field.name != "provenance"}
    return {**data, "provenance": {key: asdict(origin) for key, origin in fabric.provenance.items()}}


def _estimate_sign(fabric: Fabric, key: str) -> str:
    origin = fabric.provenance.get(key)
    if origin is None:
        return ""
    return "~" if origin.is_estimate else ">" if origin.at_least else ""
