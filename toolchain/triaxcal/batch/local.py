"""Units on this machine's cores: a pool of processes that survives the death of one.

No more units are under way than there are workers, so that those under way when a worker dies are
the only suspects. Each of them is made again, alone; the one that a worker dies on alone is
refused.
"""

from __future__ import annotations

import os
import signal
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context

from triaxcal.batch.order import Make, Order, Outcome, refused

_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""A worker uses one core: libraries must not start threads of their own."""
_OF_THE_TERMINAL = {signal.SIGINT, getattr(signal, "SIGHUP", signal.SIGINT)}
"""Signals that a terminal sends to the workers as well."""


def cores() -> int:
    """Cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)  # of Linux alone
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def run_local(
    make: Make,
    orders: list[Order],
    jobs: int,
    finishing: Callable[[int], None] = lambda _: None,
) -> Iterator[Outcome]:
    """Outcomes of all orders as they come, on `jobs` processes.

    At an interrupt `finishing` is called with the number of units under way; they are finished and
    given before it is raised. A second interrupt ends the workers.
    """
    waiting, suspects = deque(orders), deque[Order]()
    with tempfile.TemporaryDirectory(
        prefix="triaxcal-batch-", ignore_cleanup_errors=True
    ) as scratch:
        before = {name: os.environ.get(name) for name in _ONE_THREAD}
        os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
        try:
            while waiting or suspects:
                if suspects:
                    yield from _alone(make, suspects, scratch)
                else:
                    yield from _together(
                        make, waiting, suspects, jobs, scratch, finishing=finishing
                    )
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value


def _together(
    make: Make,
    waiting: deque[Order],
    suspects: deque[Order],
    jobs: int,
    scratch: str,
    *,
    finishing: Callable[[int], None],
) -> Iterator[Outcome]:
    """Make the waiting; when a worker dies, those under way become suspects."""
    under_way: dict[Future[Outcome], Order] = {}
    with _pool(min(jobs, len(waiting)), scratch) as pool:
        try:
            while waiting or under_way:
                while waiting and len(under_way) < jobs:
                    with _uninterrupted():
                        under_way[pool.submit(make, waiting[0])] = waiting[0]
                    waiting.popleft()
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    outcome = future.result()
                    del under_way[future]
                    yield outcome
        except KeyboardInterrupt:
            # Seconds of waiting keep what is nearly done; a second interrupt does not wait.
            try:
                finishing(len(under_way))
                for future in list(under_way):
                    yield future.result()
            except BrokenProcessPool:
                pass  # the next run makes them
            except KeyboardInterrupt:
                for worker in active_children():
                    worker.terminate()
                raise
            raise
        except BrokenProcessPool:
            for future, order in under_way.items():
                if future.done() and not future.cancelled() and future.exception() is None:
                    yield future.result()
                else:
                    suspects.append(order)


def _alone(make: Make, suspects: deque[Order], scratch: str) -> Iterator[Outcome]:
    order = suspects.popleft()
    with _pool(1, scratch) as pool:
        try:
            with _uninterrupted():
                future = pool.submit(make, order)
            yield future.result()
        except BrokenProcessPool:
            yield refused(
                order,
                f"{order.folder}: the worker process died on it twice; is there enough memory? "
                "run again with fewer --jobs",
            )


def _pool(jobs: int, scratch: str) -> ProcessPoolExecutor:
    # Spawned, not forked: the progress bar has a thread, and a fork copies its locks.
    return ProcessPoolExecutor(
        max(1, jobs), mp_context=get_context("spawn"), initializer=_start, initargs=(scratch,)
    )


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Interrupts wait; in a worker that starts meanwhile, until `_start` ignores them."""
    came: list[int] = []
    # The mask is what a worker inherits; here, threads of libraries take signals in spite of it.
    handlers = {n: signal.signal(n, lambda n, _: came.append(n)) for n in _OF_THE_TERMINAL}
    before = _masked("SIG_BLOCK", _OF_THE_TERMINAL)
    try:
        yield
    finally:
        _masked("SIG_SETMASK", before)
        for name, handler in handlers.items():
            signal.signal(name, handler)
        if came:
            raise KeyboardInterrupt


def _masked(how: str, signals: Collection[int]) -> Collection[int]:
    """Change the signals that are held back; Windows holds none back, and gives none on."""
    mask = getattr(signal, "pthread_sigmask", None)
    return mask(getattr(signal, how), signals) if mask else ()


def _start(scratch: str) -> None:
    """Leave interrupts to the parent, and litter to its folder."""
    for name in _OF_THE_TERMINAL:
        signal.signal(name, signal.SIG_IGN)
    _masked("SIG_UNBLOCK", _OF_THE_TERMINAL)
    tempfile.tempdir = scratch
    threading.Thread(target=_leave_with, args=(os.getppid(),), daemon=True).start()


def _leave_with(parent: int) -> None:
    """End when the parent is gone: the pool's pipes do not show a worker that it was killed."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os.kill(os.getpid(), signal.SIGTERM)
