"""The verdict of a run: whether a garment fits, by what that was judged, why not, and what would help.

It is made once, from the entries of `metrics.json`, and read by all who show it: console, review page, PDF, batch, studio.

What fails: cloth that is stretched or sheared beyond its limit, cloth that presses beyond comfort, and a garment that is larger than it was
drafted. What is told: folds where cloth is slack, ease that was asked for and missed, openings that are needed to put it on. A drape
replaces the judgement by strain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from warpflat.core.text import other_side, without_side
from warpflat.flat.flattening.fit_report import no_cut_words, remedy_words
from warpflat.flat.model.fit import TOLERATED

__all__ = ["TOO_LARGE", "Finding", "Verdict", "judge"]

# Cloth that presses harder is felt as too tight [Pa]: discomfort begins at 60 gf/cm2 (Denton 1972, Fit, stretch and comfort).
_COMFORT = 5.9e3
#: A garment is too large if its girth exceeds the drafted one by this share: two thirds of the step between sizes, 4 cm on 88.
TOO_LARGE = 0.03
# Girths that every garment is judged by; others where ease was asked for.
_MAIN_GIRTHS = ("bust", "waist", "hip", "neck", "armhole")
# Ease that is missed by more is told [m].
_EASE_MISSED = 5e-3
# Left and right are one where their ease is equal within this [m].
_ALIKE = 5e-4
_MOST_PLACES = 5

Kind = Literal["held", "pressing", "too large", "misfit", "not at rest", "folds", "ease", "opening"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that was found.

    Attributes:
        kind: what it is about.
        fails: whether the garment does not fit because of it.
        words: what, where and how much.
        remedy: what would help; "" where nothing is known.
    """

    kind: Kind
    fails: bool
    words: str
    remedy: str = ""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Whether a garment fits.

    Attributes:
        by: what it was judged by: its strain against the surface, or its drape.
        findings: those that fail first.
    """

    by: Literal["strain", "drape"]
    findings: tuple[Finding, ...]

    @property
    def fits(self) -> bool:
        """True if nothing fails."""
        return not any(finding.fails for finding in self.findings)

    @property
    def words(self) -> str:
        """The verdict in words, such as "fits by its strain"."""
        how = "by its strain" if self.by == "strain" else "as draped"
        return f"{'fits' if self.fits else 'does not fit'} {how}"

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `verdict` of `metrics.json`."""
        return {
            "fits": self.fits,
            "by": self.by,
            "words": self.words,
            "findings": [asdict(finding) for finding in self.findings],
        }


def judge(metrics: Mapping[str, Any]) -> Verdict | None:
    """Return the verdict on a run; None where nothing was worn.

    Args:
        metrics: as `metrics.json`.
    """
    drape, found = metrics.get("drape"), list[Finding]()
    worn = {name: piece["wear"] for name, piece in metrics["pieces"].items() if piece.get("wear")}
    if drape is None and not worn:
        return None
    if drape is not None:
        if not drape["converged"]:
            found.append(
                Finding(
                    kind="not at rest",
                    fails=True,
                    words="the draped cloth is not at rest",
                    remedy="allow it more steps",
                )
            )
        # Its places are the worst first.
        for place in drape["places"][:_MOST_PLACES]:
            kind: Kind = "held" if place["kind"] in ("strain", "shear") else "misfit"
            found.append(Finding(kind=kind if place["fails"] else "folds", fails=place["fails"], words=place["words"]))
    else:
        found += _held(metrics["wear"], worn, {name: float(metrics["pieces"][name]["area_m2"]) for name in worn})
        # What the strain around the body tells where the garment is smaller than it.
        wearer = metrics["wear"].get("wearer") or {}
        worst, pressure = wearer.get("most_stretched"), wearer.get("pressure_pa")
        if worst is not None and worst["strain"] > wearer["strain_limit"]:
            found.append(
                Finding(
                    kind="held",
                    fails=True,
                    words=f"stretched by {100 * worst['strain']:.1f} % around the body, {worst['place']}, beyond the cloth's limit",
                    remedy="give more ease there, or choose a stretchier cloth",
                )
            )
        if pressure is not None and pressure["p95"] > _COMFORT:
            found.append(
                Finding(
                    kind="pressing",
                    fails=True,
                    words=f"presses with {pressure['p95']:,.0f} Pa, most {pressure['place']}; {_COMFORT:,.0f} Pa are felt as too tight",
                    remedy="give more ease there, or choose a softer cloth",
                )
            )
    # Levels at which the garment is larger than it was drafted, and those whose ease is not the one asked for.
    girths: Mapping[str, Mapping[str, float]] = metrics.get("girths") or {}
    for level, girth in girths.items():
        other = girths.get(other_side(level), girth)
        alike = other is not girth and abs(other["ease_m"] - girth["ease_m"]) < _ALIKE
        if alike and level != without_side(level) + " left":
            continue
        name, asked = without_side(level) if alike else level, girth.get("ease_wanted_m")
        ease, drafted = girth["ease_m"], girth["form_m"] - girth["body_m"]
        if (asked is not None or without_side(level) in _MAIN_GIRTHS) and ease - drafted > TOO_LARGE * girth["form_m"]:
            found.append(
                Finding(
                    kind="too large",
                    fails=True,
                    words=f"too large: {name} {100 * ease:+.1f} cm, {100 * drafted:+.1f} were drafted",
                    remedy=f"take it in at the {name}",
                )
            )
        elif asked is not None and abs(ease - asked) > _EASE_MISSED:
            words = f"ease: {name} {100 * ease:+.1f} cm, {100 * asked:+.1f} asked for"
            found.append(Finding(kind="ease", fails=False, words=words))
    found += [
        Finding(
            kind="opening",
            fails=False,
            words=f"needs an opening of {ring['opening_needed_mm'] / 10:g} cm at the {ring['name']} to be put on: "
            f"{ring['length_mm'] / 10:.1f} cm around, and {ring['girth_mm'] / 10:.1f} cm must pass ({ring['over']})",
        )
        for ring in metrics.get("rings") or ()
        if ring["passes"] is False
    ]
    found.sort(key=lambda finding: not finding.fails)
    return Verdict(by="strain" if drape is None else "drape", findings=tuple(found))


def _held(
    garment: Mapping[str, Any], worn: Mapping[str, Mapping[str, Any]], areas: Mapping[str, float]
) -> list[Finding]:
    """Return what the strain of the pieces against their surface tells: cloth held beyond its limit, and folds."""
    held, slack, found = garment["held"], garment["slack"], list[Finding]()
    if held > TOLERATED:
        worst = max(worn, key=lambda name: worn[name]["held"] * areas[name])
        wear = worn[worst]
        sewn = "outside_unsewn" in wear
        before = wear["outside_unsewn"] if sewn else wear["outside"]
        # Of cuts that were tried the one that leaves least; those that were not are in the order of their promise.
        best = min(
            wear["would_help"],
            key=lambda remedy: 1.0 if remedy["outside_after"] is None else remedy["outside_after"],
            default=None,
        )
        place = next(iter(wear["where_not"]), "")
        found.append(
            Finding(
                kind="held",
                fails=True,
                words=f"{100 * held:.1f} % of the cloth is held beyond its limit; {worst}: {place}",
                remedy=no_cut_words(before, sewn=sewn) if best is None else remedy_words(best, before, sewn=sewn),
            )
        )
    if slack > TOLERATED:
        worst = max(worn, key=lambda name: worn[name]["slack"] * areas[name])
        place = next(iter(worn[worst]["where_slack"]), "")
        found.append(
            Finding(
                kind="folds", fails=False, words=f"{100 * slack:.1f} % of the cloth lies in folds; {worst}: {place}"
            )
        )
    return found
