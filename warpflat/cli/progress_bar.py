"""The progress bar on standard error."""

from __future__ import annotations

import math
import sys
from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Any

from warpflat.core.activity import activity_listener

if TYPE_CHECKING:
    from warpflat.flattening.progress import Progress

__all__ = ["ProgressBar"]


_REFRESH = 0.1  # [s]
_STEPS = "{desc}: {n_fmt} steps [{elapsed}{postfix}]"
_DOING = "{desc} [{elapsed}]"


class ProgressBar:
    """Steps, energy and residual on stderr while a run goes on, or what else it does; nothing where stderr is no terminal or `hidden`."""

    def __init__(self, name: str, *, hidden: bool = False) -> None:
        """Show nothing yet: `name` is what is being flattened."""
        self._name = name
        self._hidden = hidden or not sys.stderr.isatty()
        self._bar: Any = None
        self._stage = ""
        self._listening = ExitStack()

    def __enter__(self) -> ProgressBar:
        if not self._hidden:
            from tqdm import tqdm

            self._bar = tqdm(
                desc=self._name,
                file=sys.stderr,
                leave=False,
                mininterval=_REFRESH,
                bar_format=_DOING,
            )
            self._listening.enter_context(activity_listener(self.say))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.close()
        if self._bar is not None:
            self._bar.close()

    def say(self, words: str) -> None:
        """Show what is being done."""
        if self._bar is not None:
            self._bar.bar_format = _DOING
            self._bar.set_description_str(f"{self._name}: {words}", refresh=True)

    def __call__(self, progress: Progress) -> None:
        """Show where the run stands."""
        if self._bar is None:
            return
        if progress.stage != self._stage and progress.step == 0:
            self._bar.reset()
        self._stage = progress.stage
        self._bar.bar_format = _STEPS
        self._bar.set_description_str(f"{self._name}: {progress.stage}", refresh=False)
        told = f"model energy {progress.model_energy * 1e3:.4g} mJ"
        if math.isfinite(progress.residual):
            told += f", residual {progress.residual:.1e}"
        self._bar.set_postfix_str(told, refresh=False)
        self._bar.update(max(0, progress.step - self._bar.n))
