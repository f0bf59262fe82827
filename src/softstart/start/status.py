"""How a start ended."""

from __future__ import annotations

from enum import Enum

from softstart.kernel import records as rec


class Status(Enum):
    """How a start ended; the value is the sentence shown.

    A start that could not be `finished` is an error where it is single, and NaN in every figure of a batch.

    Examples
    --------
    >>> Status.REACHED.success, Status.REACHED.message
    (True, 'The load reached its target speed.')
    >>> [status.name for status in Status if status.finished]
    ['REACHED', 'STOPPED_EARLY', 'NOT_REACHED', 'FAULT', 'NOT_RELEASED', 'CARRIED_OUT']
    """

    REACHED = "The load reached its target speed."
    STOPPED_EARLY = "The run ended at the time asked for; the load does not have its target speed."
    NOT_REACHED = "The load did not reach its target speed within the time limit."
    FAULT = "The controller found a fault in what it measured, and demanded no torque from then on."
    TOO_MANY_EVENTS = "The start was given up: it has more events or control instants than are computed."
    NOT_LOCATED = "The start was given up: an event could not be located to machine precision."
    NOT_FINITE = "The start was given up: a state is no longer a finite number."
    BAD_COMMAND = (
        "The start was given up: the controller answered with NaN or with a past instant, "
        "or with a slope without an end."
    )
    QUEUE_FULL = (
        "The start was given up: more than 16 answers of the controller are on their way at once; shorten "
        "the drive's computing_delay, or sample less often."
    )
    NOT_RELEASED = (
        "The run ended with the motor still held by its brake: the motor torque did not reach the shaft "
        "torque, or the release time lies later."
    )
    TOO_LONG = (
        "The start was given up: it lasts more than 100,000 elastic periods of the drive. Check the units of "
        "inertias, stiffness and target speed, or end the run earlier (until)."
    )
    TOO_STIFF = (
        "The start was given up: it takes more steps of computation, or more memory (1 GB), than a start "
        "may have, as its fastest motion is too fast for so long a start. Check the units of damping, "
        "stiffness and inertias, or end the run earlier (until)."
    )
    NO_BETTER = "The start was given up: its peak or its time is already beyond that of a better one."
    CARRIED_OUT = "The duty was carried out."
    NOT_CARRIED_OUT = (
        "The duty was given up: a step cannot be finished, or does not end; run_duty says which."
    )

    @property
    def finished(self) -> bool:
        """Whether the run went to its end, so that its figures are valid."""
        return self in _FINISHED

    @property
    def success(self) -> bool:
        """Whether the load reached its target speed, or a duty was carried out."""
        return self in (Status.REACHED, Status.CARRIED_OUT)

    @property
    def message(self) -> str:
        """The sentence that says how the start ended."""
        return self.value


_RUN = {Status.REACHED, Status.STOPPED_EARLY, Status.NOT_REACHED, Status.NOT_RELEASED, Status.FAULT}
_FINISHED = frozenset(_RUN | {Status.CARRIED_OUT})
_BROKEN = {
    rec.EVENT_LIMIT: Status.TOO_MANY_EVENTS,
    rec.NOT_LOCATED: Status.NOT_LOCATED,
    rec.NOT_FINITE: Status.NOT_FINITE,
    rec.BAD_COMMAND: Status.BAD_COMMAND,
    rec.QUEUE_FULL: Status.QUEUE_FULL,
    rec.TOO_LONG: Status.TOO_LONG,
    rec.TOO_STIFF: Status.TOO_STIFF,
    rec.NO_BETTER: Status.NO_BETTER,
}


def status_of(reason: int, reached: bool, asked_for_end: bool, held: bool = False) -> Status:
    """The status from the kernel's reason for coming back; `held` if the brake was not released."""
    if reason in _BROKEN:
        return _BROKEN[reason]
    if held:
        return Status.NOT_RELEASED
    if reached:
        return Status.REACHED
    return Status.STOPPED_EARLY if asked_for_end else Status.NOT_REACHED
