"""One start again and again with one unknown moved: the loop over the unknowns, compiled.

The kernel's own functions come in as first-class functions and the places in its arrays as an argument:
this loop holds nothing of the plant, so no edit there leaves an old plant in this file's compiled cache.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from softstart.plant import layout as at
from softstart.plant import record
from softstart.plant.jit import compiled_as
from softstart.plant.start import N_MEASURED, STEP_SIGNATURE, run

_A = types.Array(types.float64, 1, "C")
_I = types.Array(types.int64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_STEP = types.FunctionType(STEP_SIGNATURE)
_RUN_SIGNATURE = types.int64(_STEP, _A, _A, types.int64, _A, _A, _A, _A, _A, _M, _M, _M)
_AT_SIGNATURE = types.void(_A, _M, _I, _A, _A, _A, _M)
_RUN, _AT = types.FunctionType(_RUN_SIGNATURE), types.FunctionType(_AT_SIGNATURE)

# what `places` holds
SPANS, SPAN_START, FULL, FIRST_OUT, SECOND_OUT = range(5)


@compiled_as(
    types.boolean(
        _RUN, _AT, _STEP, _A, _M, _A, types.int64, _A, _I, _A, _A, _A, _A, _A, _M, _M, _M, _A, _A, _M, _M, _M,
        _I,
    )
)  # fmt: skip
def _all_moved(  # type: ignore[no-untyped-def]
    run_start, states_at, step, p, rows, begun, sees, times, index, x, m, measured, state, command, segments,
    events, stages, scratch_x, scratch_m, out, first, second, places,
):  # fmt: skip
    for r in range(rows.shape[0]):
        for j in range(x.shape[0]):
            x[j] = begun[j]
        for j in range(m.shape[0]):
            m[j] = 0.0
        for j in range(state.shape[0]):
            state[j] = 0.0
        reason = run_start(step, p, rows[r], sees, x, m, measured, state, command, segments, events, stages)
        if reason == places[FULL]:
            return False
        count = int(x[places[SPANS]])
        for i in range(times.shape[0]):
            low, high = 0, count
            while high - low > 1:
                middle = (low + high) // 2
                if segments[middle, places[SPAN_START]] <= times[i]:
                    low = middle
                else:
                    high = middle
            index[i] = low
        states_at(p, segments, index, times, scratch_x, scratch_m, out)
        for i in range(times.shape[0]):
            first[r, i] = out[i, places[FIRST_OUT]]
            second[r, i] = out[i, places[SECOND_OUT]]
    return True


def all_moved(
    step: Any, p: at.Vector, rows: at.Matrix, begun: at.Vector, sees: int, state_size: int, command_size: int,
    times: at.Vector, records: int,
) -> tuple[at.Matrix, at.Matrix]:  # fmt: skip
    """Shaft torque and load speed at `times` of one start under each row of controller parameters.

    `begun` is the kernel's state at t = 0, `records` about how many spans one start has.
    """
    out = np.empty((times.size, record.N_OUT))
    T, w2 = np.empty((rows.shape[0], times.size)), np.empty((rows.shape[0], times.size))
    places = np.array([at.N_SEGMENTS, at.S_START, at.BUFFER_FULL, record.T_OUT, record.W2_OUT])
    while True:
        tapes = (np.zeros((records, n)) for n in (at.N_SEGMENT, at.N_EVENT, at.N_STAGE))
        if _all_moved(
            run, record.states_at, step, p, rows, begun, sees, times, np.zeros(times.size, dtype=np.int64),
            np.zeros(at.N_X), np.zeros(at.N_M), np.zeros(N_MEASURED), np.zeros(state_size),
            np.zeros(command_size), *tapes, np.zeros(at.N_X), np.zeros(at.N_M), out, T, w2, places,
        ):  # fmt: skip
            return T, w2
        records *= 2
