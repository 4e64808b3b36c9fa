"""Reports on the fit: the entry `wear` of `metrics.json`, and the lines on the console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from warpflat.core.arrays import IntArray
from warpflat.core.short_repr import short_repr
from warpflat.core.toml_file import tables_as_toml
from warpflat.flat.model.fit import TOLERATED, WornFit
from warpflat.flat.model.wear import Wear

__all__ = [
    "RANGES",
    "STRAINS",
    "Remedy",
    "fit_lines",
    "garment_wear",
    "limit_words",
    "no_cut_words",
    "pressure_words",
    "remedy_words",
    "strain_words",
    "wear_measures",
    "wearer_places",
    "wearer_words",
]


#: The meaning of ranges of strain and pressure.
RANGES = "5 to 95 % of the cloth [all of it]"

#: The strains of an entry `wear`: its key, the word for it, the factor to the unit shown, and that unit.
STRAINS = (
    ("strain_warp", "warp", 100.0, "%"),
    ("strain_weft", "weft", 100.0, "%"),
    ("shear", "shear", 1.0, "degrees"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Remedy:
    """A cut, sewn as a dart or a seam, that may relieve a misfit.

    Attributes:
        words: what to cut.
        path: vertices of the uncut surface.
        length: [m].
        outside: share of the cloth beyond the limit once it is made, by trial and unsewn; None if it was not tried.
        table: that makes it as one of a scene's `[[cuts]]`; None where a scene cannot.
    """

    __repr__ = short_repr

    words: str
    path: IntArray
    length: float
    outside: float | None = None
    table: Mapping[str, Any] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the remedy as an entry of `would_help` in `metrics.json`."""
        return {
            "cut": self.words,
            "length_m": self.length,
            "outside_after": self.outside,
            **({} if self.table is None else {"table": dict(self.table)}),
        }


def wear_measures(
    fit: WornFit, *, wear: Wear | None = None, unsewn: WornFit | None = None, remedies: Sequence[Remedy] = ()
) -> dict[str, Any]:
    """Build the entry `wear` of a piece in `metrics.json`.

    Args:
        fit: how the piece sits.
        wear: how it is meant to be worn, if that was asked for.
        unsewn: how it sat before it was sewn, if it was.
        remedies: cuts that may help.
    """
    measures = {**(asdict(wear) if wear is not None else {}), **fit.as_dict()}
    if unsewn is not None:
        measures["outside_unsewn"] = unsewn.outside
    measures["would_help"] = [remedy.as_dict() for remedy in remedies]
    return measures


def garment_wear(pieces: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Build the entry `wear` of a garment from the entries of its pieces in `metrics.json`.

    Args:
        pieces: by name, with `wear` and `area_m2`.
    """
    worn = {name: piece["wear"] for name, piece in pieces.items()}
    area = {name: float(piece["area_m2"]) for name, piece in pieces.items()}
    unfit = {name: wear for name, wear in worn.items() if wear["held"] > TOLERATED}
    shares = {
        key: sum(wear[key] * area[name] for name, wear in worn.items()) / sum(area.values())
        for key in ("outside", "held", "slack")
    }
    return {
        **shares,
        "where_not": [f"{name}: {words}" for name, wear in unfit.items() for words in wear["where_not"]],
        "would_help": [{"piece": name, **remedy} for name, wear in unfit.items() for remedy in wear["would_help"]],
    }


def remedy_words(remedy: Mapping[str, Any], outside: float | None = None, *, sewn: bool = False) -> str:
    """Return a remedy as a line of text.

    Args:
        remedy: as in `metrics.json`.
        outside: share of the cloth beyond the limit without it, if that is to be shown.
        sewn: whether the piece is sewn; both shares are those of the unsewn piece.
    """
    after = remedy["outside_after"]
    if after is None:
        return f"may help: {remedy['cut']}"
    before = "" if outside is None else f"{100 * outside:.1f} % -> "
    unsewn = ", unsewn" if sewn else ""
    return f"would help: {remedy['cut']}: {before}{100 * after:.1f} % beyond the limit{unsewn}"


def no_cut_words(outside: float, *, sewn: bool) -> str:
    """Return what helps a piece that no cut helps.

    Args:
        outside: share of its cloth beyond the limit.
        sewn: whether the piece is sewn; the share is that of the unsewn piece.
    """
    if sewn and outside <= TOLERATED:
        return "without its seams the piece fits; relax its seams, folds or constraints, or choose a stretchier fabric"
    return "would help: another fabric, or another stretch; no single dart does"


def strain_words(wear: Mapping[str, Any]) -> list[str]:
    """Return the ranges of strain and shear of an entry `wear`, such as "weft -0.6 to +8.6 % [-2.7 to +20.3]" (see `RANGES`)."""
    found = []
    for key, word, factor, unit in STRAINS:
        low, least, most, high = (factor * wear[key][at] for at in ("min", "p05", "p95", "max"))
        found.append(f"{word} {least:+.1f} to {most:+.1f} {unit} [{low:+.1f} to {high:+.1f}]")
    return found


def limit_words(wear: Mapping[str, Any]) -> str:
    """Return the limits of an entry `wear`, such as "5 % and 15 degrees"."""
    shear = "" if wear["shear_limit"] is None else f" and {wear['shear_limit']:.3g} degrees"
    return f"{100 * wear['strain_limit']:.3g} %{shear}"


def pressure_words(wear: Mapping[str, Any]) -> str:
    """Return the range of the pressure of an entry `wear` as text; nothing if the cloth does not press."""
    pressure = wear["pressure"]
    if pressure["max"] < 1.0:
        return ""
    return f"pressure {pressure['p05']:,.0f} to {pressure['p95']:,.0f} Pa [up to {pressure['max']:,.0f}]"


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
        lines += [wearer_words(wearer), *filter(None, [wearer_places(wearer)])]
    if verdict := metrics.get("verdict"):
        lines.append(verdict["words"])
        lines += [
            "; ".join(filter(None, [f"  {finding['words']}", finding["remedy"]])) for finding in verdict["findings"]
        ]
    return lines


def wearer_words(wearer: Mapping[str, Any]) -> str:
    """Return how a garment lies on the body: strain and pressure where the cloth is smaller, and the ease where it is larger."""
    # Levels of a left and a right limb are one where they are equal within 0.5 mm and 0.05 %.
    levels, found = wearer["levels"], dict[str, Mapping[str, Any]]()
    for name, level in levels.items():
        both, _, side = name.rpartition(" ")
        other = levels.get(f"{both} {'left' if side == 'right' else 'right'}")
        same = other is not None and all(abs(level[key] - other[key]) < 5e-4 for key in ("ease_m", "strain"))
        found[both if same else name] = level
    tight, loose = [], []
    for name, level in found.items():
        ease = f"{name} {100 * level['ease_m']:+.1f} cm"
        if level["strain"] == 0.0:
            loose.append(ease)
            continue
        pressure = max(side["pressure_pa"] for side in level["sides"].values())
        tight.append(f"{ease} ({100 * level['strain']:.1f} %, {pressure:,.0f} Pa)")
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
