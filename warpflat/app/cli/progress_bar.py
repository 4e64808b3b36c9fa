"""The progress bar on standard error."""

from __future__ import annotations

import math
import sys
import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from warpflat.core import activity_listener

if TYPE_CHECKING:
    from warpflat.flat import Progress

__all__ = ["ProgressBar"]


_REFRESH = 0.1  # [s]
_TICK = 0.5  # [s] between refreshes of the time while nothing else changes
_STEPS = "{desc}: {n_fmt} steps [{elapsed}{postfix}]"
_ACTIVITY = "{desc} [{elapsed}]"


class ProgressBar:
    """A bar on stderr with steps, model energy and residual, or the activity of a run; nothing if stderr is no terminal."""

    def __init__(self, name: str, *, hidden: bool = False) -> None:
        """Prepare the bar.

        Args:
            name: of what is flattened.
            hidden: show nothing.
        """
        self._name = name
        self._hidden = hidden or not sys.stderr.isatty()
        self._bar: Any = None
        self._stage = ""
        self._listening = ExitStack()
        self._ended = threading.Event()

    def __enter__(self) -> ProgressBar:
        if not self._hidden:
            from tqdm import tqdm

            self._bar = tqdm(
                desc=self._name,
                file=sys.stderr,
                leave=False,
                mininterval=_REFRESH,
                bar_format=_ACTIVITY,
            )
            self._listening.enter_context(activity_listener(self.show_activity))
            threading.Thread(target=self._tick, name="warpflat-bar", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.close()
        self._ended.set()
        if self._bar is not None:
            self._bar.close()

    def _tick(self) -> None:
        """Let the time go on while a long step says nothing."""
        while not self._ended.wait(_TICK):
            with self._bar.get_lock():
                if not self._ended.is_set():
                    self._bar.refresh()

    def show_activity(self, activity: str) -> None:
        """Show what the run does."""
        if self._bar is not None:
            self._bar.bar_format = _ACTIVITY
            self._bar.set_description_str(f"{self._name}: {activity}", refresh=True)

    def __call__(self, progress: Progress) -> None:
        """Show the progress of a relaxation."""
        if self._bar is None:
            return
        if progress.stage != self._stage and progress.step == 0:
            self._bar.reset()
        self._stage = progress.stage
        self._bar.bar_format = _STEPS
        self._bar.set_description_str(f"{self._name}: {progress.stage}", refresh=False)
        numbers = f"model energy {progress.model_energy_j * 1e3:.4g} mJ"
        if math.isfinite(progress.residual):
            numbers += f", residual {progress.residual:.1e}"
        self._bar.set_postfix_str(numbers, refresh=False)
        self._bar.update(max(0, progress.step - self._bar.n))
