"""A strategy and its guard as C, Structured Text or FMU: `export_controller`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from softstart.chain.machines import MachineLike
from softstart.controller.finding import Named, make_controller
from softstart.errors import SimulationError
from softstart.export.closed_loop import TOLERABLE, compiler, k_dyn_in_c, k_dyn_in_python, replayed
from softstart.export.code import KEYWORDS, BlockCode, fmu_names, fmus, written
from softstart.export.design import Design, design_for, figures_of
from softstart.export.guide import guide
from softstart.export.package import (
    LANGUAGES,
    PRECISIONS,
    README,
    Export,
    Language,
    Real,
    check_choice,
    check_folder,
    check_prefix,
    prefix_of,
    write_files,
)  # fmt: skip
from softstart.export.vectors import WORN, Vectors, make_vectors
from softstart.quantities import time_above_0


def export_controller(
    controller: Named,
    drive: MachineLike,
    language: Language = "c",
    folder: str | Path | None = None,
    *,
    real: Real = "float64",
    prefix: str = "",
    period: float | str | None = None,
    parameters: Mapping[str, object] | None = None,
    origin: str = "",
) -> Export:
    """Write a strategy with its guard as a program for a PLC, a drive or a simulator.

    What is written is the step of the strategy and of `control_block`, translated statement by statement. Its
    parameters are rounded as on the parameter sheet. With it come vectors of real starts, a program that
    tests it, and a README on how to connect it.

    Parameters
    ----------
    controller : a compiled strategy: name, `path/to/file.py:ClassName`, file of tuned gains, or Controller.
    drive : the drive or chain for which it is set up, and whose limits it keeps.
    language : "c" for C99, "st" for Structured Text of IEC 61131-3, "fmu" for FMI 2.0 and 3.0.
    folder : where the files go; one that an export has written is replaced. None writes nothing.
    real : "float64", or "float32" for controllers without double precision: times and angles stay double.
    prefix : of all names in the code; by default the name of the strategy.
    period : time between two calls, s or with a unit; by default the strategy's own, or 1 ms.
    parameters : of a strategy that is given by name.
    origin : the command that is named in the README.

    Returns
    -------
    The files, K_dyn under the exported block beside that of `simulate`, and notes.

    Raises
    ------
    InputError
        For a controller in plain Python or one that cannot be translated, an unknown language, a prefix that
        is no name, or a folder with other files in it.
    SimulationError
        If the machine cannot be started with it.

    Examples
    --------
    >>> export = export_controller("ramp", "crane-4amtkf", "c")
    >>> sorted(export.files)
    ['Makefile', 'README.md', 'ramp.c', 'ramp.h', 'test_ramp.c', 'vectors.csv']
    >>> round(export.figures["k_dyn_in_cycles"], 4)
    2.1041
    """
    check_choice(language, tuple(LANGUAGES), "language")
    check_choice(real, PRECISIONS, "real")
    if folder is not None:
        check_folder(folder)
    design = design_for(
        make_controller(controller, parameters),
        drive,
        None if period is None else time_above_0(period, "period", ""),
    )
    chosen = check_prefix(
        prefix or prefix_of(type(design.ready).name or type(design.ready).__name__), KEYWORDS
    )
    vectors = make_vectors(design.controller, design.machine, design.period, real)
    code = written(design, vectors, language, chosen, real)
    figures: dict[str, Any] = {**figures_of(design), **code.figures}
    notes = [*code.notes, *_period_notes(design)]
    if real == "float32":
        vectors, said = _single_precision(design, vectors, code, figures)
        notes += said
    export = Export(chosen, language, real, _files(design, vectors, code, figures, notes, origin), figures,
                    tuple(notes))  # fmt: skip
    if folder is None:
        return export
    write_files(folder, export.files)
    return replace(export, folder=str(folder))


def _files(
    design: Design,
    vectors: Vectors,
    code: BlockCode,
    figures: Mapping[str, Any],
    notes: list[str],
    origin: str,
) -> dict[str, str | bytes]:
    """All files of the export."""
    files: dict[str, str | bytes] = {**code.files, "vectors.csv": vectors.csv()}
    fmu = code.language == "fmu"
    names = sorted([*files, *(fmu_names(code.prefix).values() if fmu else ())])
    readme = guide(design, vectors, code.prefix, code.language, code.real, figures, notes, origin, names)
    return {**files, README: readme, **(fmus(design, code, readme) if fmu else {})}


def _period_notes(design: Design) -> list[str]:
    own = getattr(design.ready, "period", None)
    if not own:  # not sampled: asked when it wants to be, here at the next cycle
        return [f"The strategy is not sampled; here it acts in cycles of {1e3 * design.period:.6g} ms."]
    if float(own) == design.period:
        return []
    return [
        f"The strategy was designed for a cycle of {1e3 * float(own):.6g} ms and is called every "
        f"{1e3 * design.period:.6g} ms: check K_dyn below."
    ]


def _single_precision(
    design: Design, vectors: Vectors, code: BlockCode, figures: dict[str, Any]
) -> tuple[Vectors, list[str]]:
    """What single precision does, by the C code itself: its vectors, and notes; K_dyn among the figures.

    In the vectors a strategy that decides a cycle later, by a rounding, goes on differently with the same
    inputs. So what they expect is what this code answers, and how far it is from the double one is a figure.
    """
    if not compiler():
        return vectors, [
            "float32 was not checked, as there is no C compiler here (install gcc): vectors.csv is from "
            "float64, and a strategy may decide otherwise after a rounding."
        ]
    gap = float(getattr(design.machine, "gap", 0.0) or 0.0)
    factors = (1.0, WORN) if gap > 0.0 else (1.0,)
    names = ("as it is", f"gap x{WORN:g}")[: len(factors)]
    try:
        single = k_dyn_in_c(design, code.c_sources, code.prefix, factors)
        double = k_dyn_in_python(design, factors)
        answers = replayed(design, code.c_sources, code.prefix, vectors)
    except (OSError, SimulationError) as error:
        return vectors, [f"float32 was not checked in closed loop: {' '.join(str(error).split())[:300]}"]
    figures["k_dyn_float32"] = dict(zip(names, single, strict=True))
    changes = {name: abs(one - other) for name, one, other in zip(names, single, double, strict=True)}
    figures["k_dyn_change_float32"] = changes
    pairs = zip(answers.rows, vectors.rows, strict=True)
    off = [abs(one.torque - other.torque) for one, other in pairs]
    figures["rows_off_float32"] = sum(one > vectors.room for one in off)
    worst = max(changes, key=lambda name: changes[name])
    if changes[worst] <= TOLERABLE:
        return answers, []
    return answers, [
        f"float32 changes K_dyn by {changes[worst]:.2g} ({worst}), more than {TOLERABLE:g}: use float64 if "
        "the target has it."
    ]
