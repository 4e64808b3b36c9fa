"""One thread does all solving; of several requests the newest wins."""

from __future__ import annotations

import threading
from collections.abc import Callable

__all__ = ["Job", "Superseded", "Ticket", "Worker"]


class Superseded(Exception):
    """A newer request has come: nobody waits for what a job is doing."""


class Ticket:
    """What a running job is told.

    Attributes:
        stopped: the user wants no more of it; what has been reached is kept.
        superseded: a newer job waits.
    """

    def __init__(self) -> None:
        self.stopped = threading.Event()
        self.superseded = threading.Event()

    def go_on(self) -> bool:
        """Return False if the job is to end with what it has.

        Raises:
            Superseded: a newer job waits.
        """
        if self.superseded.is_set():
            raise Superseded
        return not self.stopped.is_set()


Job = Callable[[Ticket], None]


class Worker:
    """A thread with room for one waiting job; a newer one takes its place."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._next: tuple[Job, bool] | None = None
        self._running: Ticket | None = None
        self._may_supersede = True
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="studio", daemon=True)
        self._thread.start()

    @property
    def is_busy(self) -> bool:
        """Whether a job runs or waits."""
        with self._changed:
            return self._running is not None or self._next is not None

    def submit(self, job: Job, *, to_its_end: bool = False) -> None:
        """Run a job as soon as the present one has made way.

        Args:
            job: what is done; it asks its ticket now and then.
            to_its_end: no newer job interrupts it.
        """
        with self._changed:
            if self._running is not None and self._may_supersede:
                self._running.superseded.set()
            self._next = (job, to_its_end)
            self._changed.notify_all()

    def stop(self) -> None:
        """Let the running job end with what it has; the second time, without."""
        with self._changed:
            if self._running is not None:
                if self._running.stopped.is_set():
                    self._running.superseded.set()
                self._running.stopped.set()

    def wait(self, seconds: float) -> bool:
        """Wait until nothing runs or waits; return False if that takes longer."""
        with self._changed:
            return self._changed.wait_for(lambda: self._running is None and self._next is None, seconds)

    def close(self) -> None:
        """End the thread; a running job is superseded, or stopped if nothing may interrupt it."""
        with self._changed:
            self._closed, self._next = True, None
            if self._running is not None:
                self._running.stopped.set()
                self._running.superseded.set()
            self._changed.notify_all()
        self._thread.join(timeout=10.0)

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._next is not None or self._closed)
                if self._next is None:
                    return
                (job, to_its_end), self._next = self._next, None
                ticket = self._running = Ticket()
                self._may_supersede = not to_its_end
            try:
                job(ticket)
            except Superseded:
                pass
            finally:
                with self._changed:
                    self._running = None
                    self._changed.notify_all()
