"""Searches run at once, so that the candidates of all of them are started in one batch."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any

import numpy as np

from softstart.arrays import Vector

Cost = Callable[[Vector], Vector]
Search = Callable[[Cost], Any]
Batch = Callable[[Vector, Vector], Vector]  # whose place each row is, and the rows, to their costs


class _StoppedError(Exception):
    """Ends a search that is waiting when another one has failed."""


def together(batch: Batch, searches: Sequence[Search]) -> list[Any]:
    """The results of searches, each a function of a cost function, in order.

    Each search runs as if it were alone, in a thread of its own. Whenever all that still run have asked for
    the costs of some places, `batch` is called once with these, in the calling thread. A cost depends on the
    search and the place alone, so the results do not depend on what else runs.

    >>> def halve(cost):
    ...     return float(cost(np.array([[2.0]]))[0]) / 2
    >>> together(lambda whose, places: places[:, 0] * (1 + whose), [halve, halve])
    [1.0, 2.0]
    """
    asked: SimpleQueue[tuple[int, bool, Any]] = SimpleQueue()
    answers: list[SimpleQueue[Any]] = [SimpleQueue() for _ in searches]

    def run(index: int, search: Search) -> None:
        def cost(places: Vector) -> Vector:
            asked.put((index, False, places))
            answer = answers[index].get()
            if answer is None:
                raise _StoppedError
            found: Vector = answer
            return found

        try:
            asked.put((index, True, search(cost)))
        except BaseException as error:
            asked.put((index, True, error))

    threads = [threading.Thread(target=run, args=pair, daemon=True) for pair in enumerate(searches)]
    for thread in threads:
        thread.start()
    found: list[Any] = [None] * len(searches)
    running, waiting = len(searches), dict[int, Vector]()
    try:
        while running:
            index, ended, what = asked.get()
            if ended:
                running -= 1
                if isinstance(what, BaseException):
                    raise what
                found[index] = what
            else:
                waiting[index] = what
            if running and len(waiting) == running:
                order = sorted(waiting)
                rows = [waiting[i] for i in order]
                costs = batch(np.repeat(order, [len(row) for row in rows]), np.concatenate(rows))
                waiting.clear()
                for i, part in zip(
                    order, np.split(costs, np.cumsum([len(row) for row in rows])[:-1]), strict=True
                ):
                    answers[i].put(part)
    finally:
        for queue in answers:
            queue.put(None)  # whoever still waits is sent home
        for thread in threads:
            thread.join()
    return found
