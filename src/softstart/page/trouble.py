"""Whatever goes wrong, as one plain sentence: nobody who looks at the page ever sees a traceback."""

from __future__ import annotations

import logging

from softstart.errors import InputError, SimulationError

log = logging.getLogger("softstart.page")
LONGEST = 300


def sentence_of(error: BaseException) -> str:
    """What an exception says to the user of the page.

    >>> sentence_of(InputError(["gap = -1: a gap is 0 or more.", "inertia = 0: above 0."]))
    'gap = -1: a gap is 0 or more. inertia = 0: above 0.'
    >>> sentence_of(KeyError("x"))
    "This did not work, and that is a mistake in softstart, not in your input (KeyError: 'x')."
    """
    if isinstance(error, InputError):
        return " ".join(error.sentences)
    if isinstance(error, SimulationError):
        return " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return "There is not enough memory for this."
    said = " ".join(str(error).split())
    if len(said) > LONGEST:
        said = said[:LONGEST] + " ..."
    what = f"{type(error).__name__}: {said}" if said else type(error).__name__
    log.debug("told the user: %s", what, exc_info=error)
    return f"This did not work, and that is a mistake in softstart, not in your input ({what})."
