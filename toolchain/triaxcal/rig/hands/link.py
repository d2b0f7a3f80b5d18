"""A connection to an instrument that never holds up the loop, and never waits for ever."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Sequence

from triaxcal.base.errors import RefusedError
from triaxcal.rig.hands.instrument import Instrument

Numbers = Sequence[float]
Ask = Callable[[Instrument], Numbers | None]
_SLACK_S = 1.0
"""Beyond the driver's own time-outs, of opening and of asking."""


class _Job:
    """One question, in a thread of its own or at once."""

    def __init__(self, link: Link, ask: Ask) -> None:
        self.answer: Numbers = ()
        self.error = ""
        self._link = link
        self._ask = ask
        self._opened = link.opened
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._end = time.monotonic() + 2.0 * link.timeout_s + _SLACK_S
        if link.at_once:
            self._run()
        else:
            self._thread.start()

    def _run(self) -> None:
        try:
            self.answer = self._ask(self._link.instrument(self._opened)) or ()
        except Exception as error:  # each driver's library raises what its maker chose
            self.error = " ".join(str(error).split()) or type(error).__name__

    def done(self, wait_s: float = 0.0) -> bool:
        """Whether the answer or its error is there."""
        if self._thread.is_alive():
            self._thread.join(min(wait_s, max(0.0, self._end - time.monotonic())))
        if not self._thread.is_alive():
            return True
        if time.monotonic() > self._end:
            self.error = f"no answer within {self._link.timeout_s:g} s"
            return True
        return False


class Link:
    """One instrument; at most one question at a time, each tried a few times.

    After an error the connection is opened anew: a late answer must not pass for that to the next
    question.

    Parameters
    ----------
    name : str
        For messages.
    open_ : callable
        Opens the connection.
    again_s : float
        Time until a question is tried again.
    at_once : bool
        Questions are answered in the loop itself: for instruments that are simulated.

    Attributes
    ----------
    opened : int
        How often the connection was given up.
    """

    def __init__(
        self,
        name: str,
        open_: Callable[[], Instrument],
        *,
        timeout_s: float,
        again_s: float,
        attempts: int,
        at_once: bool = False,
    ) -> None:
        self.name = name
        self.timeout_s = timeout_s
        self.at_once = at_once
        self._open = open_
        self._again_s = again_s
        self._attempts = attempts
        self._instrument: Instrument | None = None
        self._job: _Job | None = None
        self._ask: Ask | None = None
        self._try_at = 0.0
        self._failed = 0
        self._lock = threading.Lock()
        self.opened = 0

    def instrument(self, opened: int) -> Instrument:
        """The open connection.

        Parameters
        ----------
        opened : int
            The attribute of this name when the question was put: one that was given up meanwhile
            must not order anything any more.

        Raises
        ------
        RefusedError
            When it was given up.
        """
        with self._lock:
            if self._instrument is not None and opened == self.opened:
                return self._instrument
        made = self._open() if opened == self.opened else None
        with self._lock:
            if made is not None and opened == self.opened:
                self._instrument = made
                return made
        if made is not None:
            made.close()
        raise RefusedError(self.name, "the question was given up")

    @property
    def busy(self) -> bool:
        """A question is under way."""
        return self._ask is not None

    def ask(self, ask: Ask, now_s: float) -> None:
        """Put a question; `collect` brings the answer."""
        self._ask, self._try_at, self._failed = ask, now_s, 0
        self._job = _Job(self, ask)

    def collect(self, now_s: float) -> Numbers | None:
        """Answer that has come since; None when there is none yet.

        Raises
        ------
        RefusedError
            When the question failed so often as is allowed.
        """
        if self._ask is None:
            return None
        if self._job is None:
            if now_s >= self._try_at:
                self._job = _Job(self, self._ask)
            return None
        if not self._job.done():
            return None
        job, self._job = self._job, None
        if not job.error:
            self._ask = None
            return job.answer
        self.drop()
        self._failed += 1
        self._try_at = now_s + self._again_s
        if self._failed >= self._attempts:
            self._ask = None
            times = f"{self._failed} times" if self._failed > 1 else "once"
            raise RefusedError(self.name, f"{job.error} (tried {times})")
        return None

    def last_order(self, ask: Ask) -> str:
        """Put a last question and wait for it; "" when it worked, or why not."""
        self._ask = None
        if self._job is not None and not self._job.done(2.0 * self.timeout_s + _SLACK_S):
            self.drop()
        error = ""
        for _ in range(self._attempts):
            job = _Job(self, ask)
            while not job.done(0.1):
                pass
            error = job.error
            if not error:
                break
            self.drop()
        self.drop()
        return error

    def drop(self) -> None:
        """Close the connection; one that hangs is left alone."""
        with self._lock:
            gone, self._instrument = self._instrument, None
            self.opened += 1

        def close() -> None:
            with contextlib.suppress(Exception):  # it is given up
                if gone is not None:
                    gone.close()

        if self.at_once:
            close()
        else:
            threading.Thread(target=close, daemon=True).start()
