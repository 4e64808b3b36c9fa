"""Write `docs/licences.md`: the packages that an installation of warpflat brings, with their licences.

python docs/make_licences.py
"""

from __future__ import annotations

import re
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

EXTRAS = ("batch", "studio")


def find_packages(name: str, extras: tuple[str, ...] = ()) -> dict[str, Distribution]:
    """Return the installed packages that a package needs, itself excepted, by name."""
    found: dict[str, Distribution] = {}
    todo = [(name, extras)]
    while todo:
        here, wanted = todo.pop()
        for line in distribution(here).requires or ():
            need = Requirement(line)
            holds = need.marker is None or any(need.marker.evaluate({"extra": extra}) for extra in ("", *wanted))
            key = re.sub(r"[-_.]+", "-", need.name).lower()
            if not holds or key in found:
                continue
            try:
                found[key] = distribution(need.name)
            except PackageNotFoundError:  # of an extra that is not installed
                continue
            todo.append((need.name, tuple(need.extras)))
    return dict(sorted(found.items()))


def licence_of(package: Distribution) -> str:
    """Return a package's licence: its SPDX expression, its classifiers, or the first line of its text."""
    about = package.metadata
    if expression := about.get("License-Expression"):
        return expression
    classifiers = [
        each.split(" :: ")[-1] for each in about.get_all("Classifier") or () if each.startswith("License ::")
    ]
    named = [each for each in classifiers if each != "OSI Approved"]
    text = (about.get("License") or "").strip()
    for name in about.get_all("License-File") or ():
        text = text or (package.read_text(f"licenses/{name}") or package.read_text(name) or "").strip()
    return ", ".join(named) or (text.splitlines() or ["not stated"])[0]


def home_of(package: Distribution) -> str:
    """Return a package's page in angle brackets, or nothing if it names none."""
    about = package.metadata
    urls = dict(line.split(", ", 1) for line in about.get_all("Project-URL") or ())
    by_name = {key.lower(): url for key, url in urls.items()}
    found = (by_name.get(key) for key in ("homepage", "home", "source", "source code", "repository", "github"))
    return next((f"<{url}>" for url in (*found, about.get("Home-page")) if url), "")


def licences_page() -> str:
    """Return the page."""
    lines = [
        "# Third-party licences", "",
        "warpflat is under Apache 2.0. It contains no code of others. Its data `garment/mannequin/data/body_model.npz`",
        "are made from MakeHuman's base mesh, targets and skin weights, which are CC0 1.0 (`make_body_model.py` beside them).",
        "An installation, with the extras `batch` and `studio`, brings these packages",
        "(`python docs/make_licences.py` reads them from the packages themselves):", "",
        "| package | licence | page |", "|---|---|---|",
    ]  # fmt: skip
    for name, package in find_packages("warpflat", EXTRAS).items():
        lines.append(f"| {name} | {licence_of(package)} | {home_of(package)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    (Path(__file__).parent / "licences.md").write_text(licences_page(), encoding="utf-8")
