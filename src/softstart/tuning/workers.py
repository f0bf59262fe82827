"""Candidates tried by several workers at once; the answer is the same with one as with many."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

from softstart.errors import InputError
from softstart.processes import Pool, checked_workers, why_not_sendable
from softstart.tuning.trials import Trials

Work = Callable[..., Any]
WORTH_SHARING = 20_000  # starts from which on processes are started


class Part(NamedTuple):
    """`work(trials, *arguments)`; `packed` makes the same trials in another process."""

    number: int
    work: Work
    arguments: tuple[Any, ...]
    packed: bytes = b""


@lru_cache(maxsize=2)
def _trials_of(packed: bytes) -> Trials:
    return Trials(*pickle.loads(packed))


def _computed_elsewhere(part: Part) -> Any:
    return part.work(_trials_of(part.packed), *part.arguments)


def _computed(trials: Trials, part: Part) -> Any:
    return part.work(trials, *part.arguments)


class Workers:
    """Spreads parts of the work on `trials` over a pool."""

    def __init__(self, trials: Trials, pool: Pool) -> None:
        self.trials, self.pool = trials, pool
        trials.stopping = pool.stopping
        self._packed = b""

    def each(self, work: Work, items: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Index and result of each item, as they are finished."""
        here = self.pool.scheduler is None and (self.pool.threads or self.pool.count == 1 or len(items) < 2)
        if not here and not self._packed:
            self._packed = pickle.dumps((self.trials.question, self.trials.yardstick))
        parts = (Part(k, work, item, b"" if here else self._packed) for k, item in enumerate(items))
        function = partial(_computed, self.trials) if here else _computed_elsewhere
        if here and len(items) < 2:
            yield from ((part.number, function(part)) for part in parts)
        else:
            yield from ((part.number, result) for part, result in self.pool.results(function, parts))

    def all(self, work: Work, items: Sequence[tuple[Any, ...]]) -> list[Any]:
        """The results in the order of the items."""
        found = dict(self.each(work, items))
        return [found[index] for index in range(len(items))]


def pool_for(trials: Trials, workers: int | None, scheduler: str | None, starts: int) -> Pool:
    """Where to make about so many starts: threads for compiled controllers, else processes, or a cluster."""
    count = checked_workers(workers, scheduler)
    if not trials.batched and starts < WORTH_SHARING:
        count = 1
    if scheduler is not None or (count > 1 and not trials.batched):
        reason = why_not_sendable(trials.question)
        if reason and (workers is not None or scheduler is not None):
            given = f"workers = {workers}" if scheduler is None else "scheduler"
            raise InputError(
                f"{given}: the controller or the metric cannot be handed to another process ({reason}); "
                "define it at the top level of a module, or give workers=1."
            )
        count = 1 if reason else count
    return Pool(count, threads=trials.batched, scheduler=scheduler, describe=_described)


def _described(part: Part) -> str:
    return f"part {part.number + 1} of the tuning"
