"""A body is fitted once to each scan."""

import pytest
from scans import stood


@pytest.fixture(autouse=True)
def _fitted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpflat.mannequin.scan.stand_body", stood)
