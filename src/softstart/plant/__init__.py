"""The two-mass drive with a gap, solved in closed form from event to event.

The kernel's files, in the order in which they build on each other: `layout` (where each number stands),
`exchange` (what is measured and answered at a control instant), `coupled` (a span with viscous friction),
`motion` (the closed forms of all others), `terms` and `crossing` (the certified first crossing), `span` (the
next event), `notes` (what is noted), `modes` (what changes at an event), `advance` (span after span to the
next control instant), `start` (one start, many starts), `record` (any instant of a recorded start), `vector`
(a Drive as numbers).
"""

from __future__ import annotations

from pathlib import Path


def _drop_stale_cache() -> None:
    """Numba notices a change in a function's own file, but not in the functions it calls.

    After an edit of one kernel file the compiled callers in the others would go on with the old code:
    wrong numbers without a word. So if any source here is newer than the oldest compiled file, all go.
    """
    here = Path(__file__).parent
    compiled = [*here.glob("__pycache__/*.nbi"), *here.glob("__pycache__/*.nbc")]
    try:
        if compiled and max(p.stat().st_mtime for p in here.glob("*.py")) > min(
            p.stat().st_mtime for p in compiled
        ):
            for path in compiled:
                path.unlink(missing_ok=True)
    except OSError:
        return  # another process is compiling or cleaning, or the folder is read-only: numba decides


_drop_stale_cache()
