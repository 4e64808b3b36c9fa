"""What `-v` tells on the console of the fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpflat.app.scene.as_toml import tables_as_toml
from warpflat.flat import TOLERATED, no_cut_words, remedy_words
from warpflat.pattern import RANGES, limit_words, pressure_words, strain_words

__all__ = ["fit_lines"]

# What is equal within this, in metres or as a share of a length, is told once.
_ALIKE = 5e-4


def fit_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Return what `-v` tells of the fit: a line per piece, one for each place and remedy where a piece is held beyond its limits."""
    lines = []
    against = metrics.get("wear", {}).get("against", "surface")
    for name, piece in metrics["pieces"].items():
        wear = piece.get("wear")
        if wear is None:
            continue
        shares = f"{100 * wear['held']:.1f} % held beyond its limit, {100 * wear['slack']:.1f} % in folds"
        ranges = f"{', '.join(strain_words(wear))}, limit {limit_words(wear)}"
        if pressure := pressure_words(wear):
            ranges += f"; {pressure}, median {wear['pressure']['p50']:.0f}"
        lines.append(f"{name}: {shares} ({ranges})")
        lines += [f"  folds: {words}" for words in wear["where_slack"]]
        if wear["held"] <= TOLERATED:
            continue
        lines += [f"  held: {words}" for words in wear["where_not"]]
        sewn = "outside_unsewn" in wear
        before = wear["outside_unsewn"] if sewn else wear["outside"]
        lines += [f"  {remedy_words(remedy, before, sewn=sewn)}" for remedy in wear["would_help"]]
        # The best of them, to be pasted into the scene.
        tables = [remedy["table"] for remedy in wear["would_help"] if "table" in remedy][:1]
        lines += [f"    {line}" for line in tables_as_toml({"cuts": tables}).splitlines()]
        if not wear["would_help"]:
            lines.append(f"  {no_cut_words(before, sewn=sewn)}")
    if lines:
        lines.append(f"ranges: {RANGES}, against the {against}")
    if wearer := metrics.get("wear", {}).get("wearer"):
        lines += [wearer_words(wearer, metrics.get("girths", {})), *filter(None, [wearer_places(wearer)])]
    if verdict := metrics.get("verdict"):
        lines.append(verdict["words"])
        lines += [
            "; ".join(filter(None, [f"  {finding['words']}", finding["remedy"]])) for finding in verdict["findings"]
        ]
    return lines


def wearer_words(wearer: Mapping[str, Any], girths: Mapping[str, Mapping[str, float]]) -> str:
    """Return how a garment lies on the body: strain and pressure where the cloth is smaller, and the ease where it is larger.

    Where a cuff or a band draws the cloth in, as the garment's `girths` tell, the ease is that of the band.
    """
    levels, found = dict(wearer["levels"]), dict[str, Mapping[str, Any]]()
    for name in levels.keys() & girths.keys():
        girth = girths[name]
        if girth["ease_m"] < levels[name]["ease_m"] - _ALIKE:
            strain = max(0.0, girth["body_m"] / girth["pattern_m"] - 1.0)
            # How hard it presses is not known: a band may be of another cloth.
            levels[name] = {"ease_m": girth["ease_m"], "strain": strain, "sides": {}}
    # Levels of a left and a right limb are one where they are equal within 0.5 mm and 0.05 %.
    for name, level in levels.items():
        both, _, side = name.rpartition(" ")
        other = levels.get(f"{both} {'left' if side == 'right' else 'right'}")
        same = other is not None and all(abs(level[key] - other[key]) < _ALIKE for key in ("ease_m", "strain"))
        found[both if same else name] = level
    tight, loose = [], []
    for name, level in found.items():
        ease = f"{name} {100 * level['ease_m']:+.1f} cm"
        if level["strain"] == 0.0:
            loose.append(ease)
            continue
        pressures = [side["pressure_pa"] for side in level["sides"].values()]
        pressure = f", {max(pressures):,.0f} Pa" if pressures else ""
        tight.append(f"{ease} ({100 * level['strain']:.1f} %{pressure})")
    words = "; ".join(f"{word} at {', '.join(row)}" for word, row in (("stretched", tight), ("ease", loose)) if row)
    return f"wearer: {words}"


def wearer_places(wearer: Mapping[str, Any]) -> str:
    """Return where on the body the cloth is stretched most and presses hardest; "" where it is larger everywhere."""
    if "pressure_pa" not in wearer:
        return ""
    worst, pressure = wearer["most_stretched"], wearer["pressure_pa"]
    return (
        f"wearer: touches with {100 * wearer['touching']:.0f} % of the cloth around; most stretched {worst['place']} "
        f"({100 * worst['strain']:.1f} %); pressure {pressure['p50']:,.0f} Pa in the middle, 95 % below "
        f"{pressure['p95']:,.0f}, most {pressure['max']:,.0f}, {pressure['place']}"
    )
