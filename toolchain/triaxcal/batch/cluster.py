"""Units on a Dask cluster that exists already; it needs triaxcal and gcc, and no shared disk."""

from __future__ import annotations

import importlib
import socket
from collections import deque
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.batch.order import Make, Order, Outcome, filled, refused
from triaxcal.batch.toolchain import toolchain

UNDER_WAY = 3
"""Units sent for each thread of the workers: none waits for us, and few are in memory."""

CONNECT_S = 10
"""Patience with a scheduler that does not answer."""


def connect(address: str) -> Any:
    """Client of the scheduler at `address`; its workers are checked.

    Raises
    ------
    RefusedError
        When distributed is not installed, nobody answers, there is no worker, or a worker has
        another triaxcal, compiler or none.
    """
    distributed = _distributed()
    try:
        _refuse_silence(address)
        client = distributed.Client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        reason = " ".join((getattr(error, "strerror", None) or str(error)).split())[:120]
        raise RefusedError(
            f"--scheduler {address}",
            f"no scheduler answers there ({(reason or type(error).__name__).lower()})",
            expected="a running Dask scheduler, as tcp://host:8786",
            remedy="start it, or leave the option out to use this machine's cores",
        ) from error
    try:
        _refuse_other_workers(client, address)
    except BaseException:
        client.close()
        raise
    return client


def workers(client: Any) -> int:
    """Threads of all workers: how many units are under way at once."""
    return sum(client.nthreads().values())


def run_cluster(client: Any, make: Make, orders: list[Order]) -> Iterator[Outcome]:
    """Outcomes of all orders as they come; the scheduler redoes the units of a dead worker."""
    distributed = _distributed()
    waiting, results = deque(orders), distributed.as_completed()
    under_way: dict[str, Order] = {}
    try:
        while waiting or under_way:
            if waiting and len(under_way) < UNDER_WAY * max(1, workers(client)):
                order = waiting.popleft()
                try:
                    content = filled(order)
                except RefusedError as refusal:
                    yield refused(order, refusal)
                    continue
                key = f"triaxcal-{order.name}-{order.key[:16]}"
                under_way[key] = order
                results.add(client.submit(make, content, key=key, pure=False))
                continue
            future = next(results)
            order = under_way.pop(future.key)
            try:
                outcome: Outcome = future.result()
            except distributed.KilledWorker:
                outcome = refused(
                    order, f"{order.folder}: the workers died on it; is there enough memory?"
                )
            future.release()
            yield outcome
    except (distributed.CancelledError, OSError) as error:
        raise RefusedError(
            "--scheduler",
            f"the cluster was lost ({type(error).__name__})",
            remedy="run again when it is back: units that were made are kept",
        ) from error


def _refuse_silence(address: str) -> None:
    """Ask the port itself first: distributed's client takes long to give up, and says much."""
    parts = urlsplit(address)
    if parts.scheme not in ("tcp", "tls") or not parts.hostname or not parts.port:
        raise ValueError("not an address")
    socket.create_connection((parts.hostname, parts.port), CONNECT_S).close()


def _distributed() -> Any:
    """The package, which only those with a cluster need."""
    try:
        return importlib.import_module("distributed")
    except ModuleNotFoundError as missing:
        raise RefusedError(
            "--scheduler",
            f"package {missing.name} is missing",
            remedy="install it: " + install_command("series"),
        ) from missing


def _refuse_other_workers(client: Any, address: str) -> None:
    if not client.scheduler_info(n_workers=-1)["workers"]:
        raise RefusedError(
            f"--scheduler {address}", "the scheduler has no workers",
            remedy="start some: dask worker " + address,
        )  # fmt: skip
    mine = toolchain()
    answers: dict[str, Any] = client.run(toolchain, on_error="return")
    for worker, answer in sorted(answers.items()):
        if answer != mine:
            found = answer if isinstance(answer, str) else f"{type(answer).__name__}: {answer}"
            raise RefusedError(
                f"--scheduler {address}, worker {worker}",
                f"has triaxcal {found}" if isinstance(answer, str) else found,
                expected=f"triaxcal {mine}: files, packages, Python and gcc as here",
                remedy="install the same there",
            )
