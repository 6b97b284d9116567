"""Who computes: this process, a Dask cluster of this machine that starts by itself, or one at an address.

All three give the same numbers: a task says which runs it wants, and a run depends on nothing else.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from itertools import islice
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeVar

from psabench.errors import BadInput, BenchError, LinkError, expected

CONNECT_S = 20.0
AHEAD = 3  # tasks handed to each worker beyond what it computes: enough to keep it busy, few enough to hold in memory

Task = TypeVar("Task")
Result = TypeVar("Result")


class Workers(Protocol):
    """Computes tasks; results come as they are ready, in any order."""

    count: int

    def map(self, compute: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]: ...


class ThisProcess:
    """One task after the other, here."""

    count = 1

    def map(self, compute: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        return map(compute, tasks)


class Dask:
    """The workers of a Dask cluster."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self.count = sum(int(n) for n in client.nthreads().values())

    def map(self, compute: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        waiting = iter(tasks)
        running = _distributed().as_completed()
        for task in islice(waiting, self.count * (1 + AHEAD)):
            running.add(self._client.submit(compute, task, pure=False))
        for future in running:
            for task in islice(waiting, 1):
                running.add(self._client.submit(compute, task, pure=False))
            yield self._result(future)

    @staticmethod
    def _result(future: Any) -> Any:
        try:
            return future.result()
        except BenchError:
            raise
        except Exception as e:
            raise BenchError(f"a worker failed: {type(e).__name__}: {e}") from e


def _distributed() -> Any:
    """The package: it takes half a second to load, and has no types to speak of."""
    return importlib.import_module("distributed")


def cores() -> int:
    """Of this machine, those that this process may use."""
    return len(os.sched_getaffinity(0))


def workers(
    count: int | None = None, address: str | None = None, chain: str = "closed", own: Callable[[], str] | None = None
) -> AbstractContextManager[Workers]:
    """Workers for as long as the context lasts: those of the Dask scheduler at `address`, such as
    tcp://192.0.2.7:8786, else `count` processes of this machine, one a core without it; 1: this process. `chain` is
    what they are to compute; `own`, for another study than gyrocompassing, names the build in place of own_build().

    Raises LinkError when nothing answers at the address, BadInput when what answers has another build.
    """
    if address is not None:
        return _cluster_at(address, own or partial(own_build, chain))
    count = cores() if count is None else count
    return nullcontext(ThisProcess()) if count == 1 else _local_cluster(count)


@contextmanager
def _local_cluster(count: int) -> Iterator[Workers]:
    with _no_interrupt_for_children():
        cluster = _distributed().LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None would listen everywhere
            silence_logs=logging.CRITICAL,
        )
    with cluster, _distributed().Client(cluster) as client:
        yield Dask(client)


@contextmanager
def _no_interrupt_for_children() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal; threads and processes that start here leave it to the main thread."""
    resource_tracker.ensure_running()  # its own start would let the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _cluster_at(address: str, own: Callable[[], str]) -> Iterator[Workers]:
    reach(address)  # a Client that finds no one does not end quietly
    try:
        client = _distributed().Client(address, timeout=CONNECT_S)
    except OSError as e:
        raise _nobody(address, e) from e
    with client:
        _same_psabench(client, address, own)
        yield Dask(client)


def reach(address: str) -> None:
    """Raises LinkError where no Dask scheduler answers."""
    distributed = _distributed()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        asyncio.run(_answer(distributed, address))
    except (OSError, ValueError) as e:
        raise _nobody(address, e) from e


def _nobody(address: str, e: Exception) -> LinkError:
    return LinkError(f"--dask {address}: no Dask scheduler answers there ({e or type(e).__name__})")


async def _answer(distributed: Any, address: str) -> None:
    comm = await distributed.comm.connect(
        address, timeout=CONNECT_S, **distributed.Security().get_connection_args("client")
    )
    await comm.close()


def own_build(chain: str) -> str:
    """What a worker and we must have in common to compute the same."""
    from psabench.campaign import builds
    from psabench.campaign.chains import CHAINS, versions

    return f"{versions()}, build {builds.short(CHAINS[chain].build())}"


def _same_psabench(client: Any, address: str, own: Callable[[], str]) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
        found: dict[str, str] = client.run(own)
    except TimeoutError as e:
        raise LinkError(f"--dask {address}: the scheduler has no workers") from e
    except Exception as e:
        raise BadInput(f"--dask {address}: {type(e).__name__} in a worker: {e}") from e
    mine = own()
    others = sorted({theirs for theirs in found.values() if theirs != mine})
    if others:
        raise BadInput(expected(f"workers with {mine}", "; ".join(others), f"--dask {address}"))


def spread(weights_s: Sequence[float], task_s: float) -> list[slice]:
    """Neighbouring parts of these durations together into tasks of about `task_s`: a Dask task costs 2 ms by itself."""
    slices, start, sum_s = [], 0, 0.0
    for i, weight_s in enumerate(weights_s):
        sum_s += weight_s
        if sum_s >= task_s:
            slices.append(slice(start, i + 1))
            start, sum_s = i + 1, 0.0
    return [*slices, slice(start, len(weights_s))] if start < len(weights_s) else slices
