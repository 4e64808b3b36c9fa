"""Damaged files and odd command lines keep the promise: some hundreds of them here, any number by `python -m tests.fuzz`.

What Hypothesis finds it shrinks; the file is printed with the failure, and belongs into tests/regressions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from .kinds import KINDS, random_case
from .known_faults import GROUPS
from .promise import Case, Verdict, Worker, broken_promise
from .regressions import cases_of, regression_files

# A few of each kind; `python -m tests.fuzz` runs thousands.
EXAMPLES = {name: max(1, kind.share // 6) for name, kind in KINDS.items()}


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    """Runs cases in a process of its own."""
    with Worker() as worker:
        yield worker


def broken(worker: Worker, case: Case) -> str:
    """How a case broke the promise, with what it was and what it said; "" where it kept it."""
    verdict = worker.run(case)
    if not verdict.broken:
        return ""
    return f"{verdict.cause}\n{case.arguments}\n{case.files.get(case.subject)!r:.3000}\n{verdict.stderr:.3000}"


@pytest.mark.parametrize("kind", list(KINDS))
def test_damaged_input_keeps_the_promise(worker: Worker, kind: str) -> None:
    @settings(
        max_examples=EXAMPLES[kind],
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(random=st.randoms(use_true_random=False))
    def damaged(random: Random) -> None:
        assert broken(worker, random_case(kind, random)) == ""

    damaged()


@pytest.mark.parametrize("group", list(GROUPS))
def test_faults_once_found_stay_mended(worker: Worker, group: str) -> None:
    verdicts = {case.name: worker.run(case) for case in GROUPS[group]()}
    assert {name: verdict.cause for name, verdict in verdicts.items() if verdict.broken} == {}


@pytest.mark.parametrize("file", [pytest.param(file, id=file.name) for file in regression_files()])
def test_a_file_that_once_broke_the_promise_keeps_it(worker: Worker, file: Path) -> None:
    cases = cases_of(file)
    assert cases
    for case in cases:
        assert broken(worker, case) == ""


# --- the harness itself


def test_a_broken_promise_is_seen(worker: Worker) -> None:
    """A refusal that was not due, and one that was but did not come."""
    refused = worker.run(Case("arguments", {}, ("flatten", "gone.obj", "--units", "m"), refused=False))
    assert (refused.code, refused.broken) == (2, "refused")
    accepted = worker.run(Case("arguments", {}, ("fabrics",), refused=True))
    assert (accepted.code, accepted.broken) == (0, "accepted")
    hangs = worker.run(Case("arguments", {}, ("fabrics",), seconds=1e-6))
    assert hangs.broken == "takes more than 1e-06 s"
    without = worker.run(Case("arguments", {}, ("fabrics",), leaves="out/metrics.json"))
    assert without.broken == "done, but without metrics.json"
    assert not worker.run(Case("arguments", {}, ("fabrics",))).broken


def test_a_note_that_names_an_error_of_python_is_an_internal_error() -> None:
    ended = Verdict(0, 0.1, 0, "", "warpflat: note: out: picture.png was left out: KeyError: 3\n")
    assert "KeyError" in broken_promise(Case("obj", {}, ()), "here", ended, {}, {})
    good = replace(ended, stderr="warpflat: note: out: picture.png was left out: it has no room\n")
    assert broken_promise(Case("obj", {}, ()), "here", good, {}, {}) == ""
