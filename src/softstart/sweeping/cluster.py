"""Chunks computed by the workers of a dask.distributed cluster; this process writes what they send back.

A chunk is one task without dependencies: when a worker is lost, another one gets its chunks.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any

from softstart.errors import InputError, SimulationError
from softstart.sweeping.starts import Block, Task, compute
from softstart.sweeping.workers import Dones

PATIENCE = 30.0  # s, for the scheduler to answer and for the first worker
ALONE = 300.0  # s, that a sweep waits for new workers when all are lost
GLANCE = 2.0  # s, between looks at the cluster
AHEAD = 2  # chunks under way for each thread of the cluster


def connect(address: str) -> Any:
    """A client of the scheduler, which has a worker. Raises InputError in one sentence."""
    try:
        distributed = import_module("distributed")  # optional, so mypy must not need it
    except ImportError:
        raise InputError(
            "scheduler: dask.distributed is not installed; it comes with pip install 'softstart[cluster]'."
        ) from None
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f'scheduler = "{address}": no dask scheduler answers there ({reason[:200]}); start one with '
            '"dask scheduler" and give its address, as tcp://host:8786.'
        ) from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        client.close()
        raise InputError(
            f'scheduler = "{address}": it has no worker; start some with "dask worker {address}".'
        ) from None
    return client


def computed_by_cluster(tasks: Iterator[Task], client: Any) -> Dones:
    """As they are finished; a bounded number is under way."""
    answers: SimpleQueue[Any] = SimpleQueue()
    running: dict[Any, Task] = {}
    run = uuid.uuid4().hex  # its chunks are not those of another sweep
    looked, room, alone = 0.0, 0, 0.0
    more = True
    while more or running:
        now = time.monotonic()
        if now - looked > GLANCE:
            threads = _threads(client)
            room = AHEAD * max(1, threads) + 1
            alone = 0.0 if threads else alone + now - looked if looked else 0.0
            looked = now
            if alone > ALONE:
                raise SimulationError(
                    f"All workers of the dask cluster are gone since {ALONE:.0f} s. Finished chunks are kept."
                )
        while more and len(running) < room:
            task = next(tasks, None)
            if task is None:
                more = False
                break
            future = client.submit(compute, task, key=f"softstart-{run}-{task.number}")
            running[future] = task
            future.add_done_callback(answers.put)
        try:
            future = answers.get(timeout=GLANCE)
        except Empty:
            continue
        yield running.pop(future), _result(future)


def _threads(client: Any) -> int:
    try:
        return sum(client.ncores().values())
    except (OSError, TimeoutError, RuntimeError, ValueError) as error:
        raise _lost(error) from None


def _result(future: Any) -> Block:
    distributed = import_module("distributed")
    try:
        block: Block = future.result()
        return block
    except distributed.KilledWorker as error:
        raise SimulationError(
            "Several workers of the dask cluster died with the same chunk "
            f"({' '.join(str(error).split())[:200]}). Finished chunks are kept."
        ) from None
    except ImportError as error:
        raise InputError(
            f"scheduler: a worker of the cluster cannot load what it needs ({error}); install there what is "
            "installed here."
        ) from None
    except (distributed.CancelledError, OSError, TimeoutError) as error:
        raise _lost(error) from None


def _lost(error: BaseException) -> SimulationError:
    what: Any = " ".join(str(error).split())[:200] or type(error).__name__
    return SimulationError(f"The dask scheduler was lost ({what}). Finished chunks are kept.")
