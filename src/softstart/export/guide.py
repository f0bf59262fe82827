"""The README of an exported controller: what who programs the PLC or the drive must know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from softstart import __version__
from softstart.controller.base import CompiledController, Controller
from softstart.controller.parameters import declared_parameters
from softstart.export.code import SIGNALS
from softstart.export.design import Design
from softstart.export.package import LANGUAGES, MARK
from softstart.export.vectors import DECLARED, Vectors
from softstart.kernel.guard import FAULTS, LATE
from softstart.kernel.records import NO_DEMAND, TORQUE_OFF
from softstart.quantities import show
from softstart.start.settings import Setting
from softstart.views.numbers import digits

KINDS = {
    "c": {"whole": "int64_t", "truth": "int", "double": "double", "real": "{P}_real"},
    "st": {"whole": "LINT", "truth": "BOOL", "double": "LREAL", "real": "{R}"},
    "fmu": {"whole": "Integer", "truth": "Boolean", "double": "Real", "real": "Real"},
}
KIND_OF = {"cycles": "whole", "fault": "whole", "run": "truth", "motor_angle": "double"}
CAUSES = {
    1: "an input is NaN or infinite: a sensor is lost, or you have said so",
    2: f"a call came more than {1.0 + LATE:g} cycles after the one before: task overrun, missed cycle",
    3: "the angle or speed changed more than the motor can move: wrong scaling, wrap, bad cable",
    4: "the torque would have moved the motor, the angle stands still: encoder, coupling, brake closed",
    TORQUE_OFF: "the realised torque is not what was demanded, 3 cycles in a row: limit, inverter off",
    NO_DEMAND: "the strategy computed no number: report it with the recorded inputs",
}


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown.

    >>> print(table(["a", "b"], [[1, 2]]))
    | a | b |
    |---|---|
    | 1 | 2 |
    """
    lines = [head, ["---"] * len(head), *rows]
    texts = ["| " + " | ".join(str(cell).replace("|", "/") for cell in line) + " |" for line in lines]
    texts[1] = texts[1].replace(" ", "")
    return "\n".join(texts)


def type_name(name: str, language: str, real: str, prefix: str) -> str:
    """The type of a signal in the language of the export."""
    kind = KINDS[language][KIND_OF.get(name, "real")]
    return kind.format(P=prefix, R="REAL" if real == "float32" else "LREAL")


def guide(
    design: Design, vectors: Vectors, prefix: str, language: str, real: str,
    figures: Mapping[str, Any], notes: Sequence[str], origin: str, files: Sequence[str],
) -> str:  # fmt: skip
    """The README of an export, in Markdown.

    Parameters
    ----------
    design, vectors : what is exported, and with what it is tested.
    prefix, language, real : of the code.
    figures : K_dyn and sizes by name.
    notes : what an engineer should know, a sentence each.
    origin : the command that made it, or "".
    files : names of the other files.
    """
    low, high = design.limits
    parts = [
        f"# {prefix}: {design.name} for {design.machine.name}\n\n{MARK}\n",
        f"A start strategy with its guard as {LANGUAGES[language]}, {real}. Call it every "
        f"{1e3 * design.period:.9g} ms; it answers with a torque demand between {low:g} and {high:g} N m. "
        "Files: " + ", ".join(f"`{name}`" for name in files) + ".",
        _notes(notes),
        "## Calling it\n\n" + _calling(design, prefix, language),
        "## Inputs and outputs\n\n" + _signals(design, vectors, prefix, language, real),
        "## Run, stop, reset\n\n" + _commands(design),
        "## Faults\n\n" + _faults(),
        "## Cycle time and missed cycles\n\n" + _cycles(design),
        "## Test\n\n" + _test(vectors, prefix, language, real, figures),
        "## What it does to the shaft\n\n" + _figures(figures, design),
        "## Parameters\n\n" + _parameters(design.ready, design.settings),
        "## Provenance\n\n" + _provenance(design, origin),
    ]
    return "\n\n".join(part.strip("\n") for part in parts if part) + "\n"


def _notes(notes: Sequence[str]) -> str:
    return "\n".join(f"- **{note}**" for note in notes)


def _calling(design: Design, prefix: str, language: str) -> str:
    if language == "c":
        return (
            f'```c\n#include "{prefix}.h"\n\nstatic {prefix}_State state;\n\n'
            f"{prefix}_init(&state);                    /* once, at power-up */\n\n"
            f"{prefix}_Input input = {{ .cycles = 1, .run = run, .set_speed = set_speed, ... }};\n"
            f"{prefix}_Output output;\n"
            f"{prefix}_step(&state, &input, &output);   /* every cycle, running or not */\n```\n\n"
            "No heap, no globals, nothing beyond `math.h`. Compile without contraction of multiplications "
            "and additions (`-ffp-contract=off`) and without `-ffast-math`: the guard relies on NaN."
        )
    if language == "st":
        return (
            f"Import the PLCopen XML file or paste the source. Declare an instance, `Start : {prefix};`, "
            f"in a cyclic task of {1e3 * design.period:.9g} ms, and call it in every cycle, running or not. "
            "Declare it without RETAIN: at power-up it begins anew."
        )
    return (
        "Load the FMU in a co-simulation. The communication step is the cycle time, or a whole multiple of "
        "it; the FMU counts the cycles itself."
    )


def _signals(design: Design, vectors: Vectors, prefix: str, language: str, real: str) -> str:
    rows = [
        [f"`{name}`", "in", type_name(name, language, real, prefix), *SIGNALS[name]]
        for name in vectors.inputs
        if not (language == "fmu" and name == "cycles")
    ]
    low, high = design.limits
    rows += [
        ["`torque`", "out", type_name("torque", language, real, prefix), "N m",
         f"torque demand until the next cycle, {low:g} to {high:g}"],
        ["`fault`", "out", type_name("fault", language, real, prefix), "",
         "0, or the code of a fault, latched"],
    ]  # fmt: skip
    target = float(design.own.target_speed)
    text = table(["signal", "", "type", "unit", "meaning"], rows)
    text += (
        "\n\nScaling: an encoder of N lines with four-fold evaluation gives `motor_angle` = 2 pi counts / "
        "(4 N). `motor_speed` = (angle - angle of the cycle before) / cycle time, unfiltered. Torque in per "
        f"cent of the rated torque: times rated torque / 100. The start is designed for {target:.6g} rad/s, "
        f"that is {target * 9.549296585513721:.6g} rpm. Positive is the direction of the start."
    )
    extra = [name for sensor, name in DECLARED.items() if design.sensors & sensor]
    if extra:
        text += (
            f"\n\nBeyond the motor's encoder and torque this strategy needs {', '.join(extra)}, which drives "
            "do not have by themselves."
        )
    return text


def _commands(design: Design) -> str:
    controller: Controller = design.ready
    text = (
        "A rising edge of `run` begins a start; time and angle are counted from it. Give it when the "
        "drive is enabled, fluxed, and its brake may open."
    )
    stops = (
        "`run` = false stops the machine along the strategy's own ramp: keep calling it and keep the drive "
        "enabled until the machine stands."
        if controller.can_stop
        else "`run` = false gives torque 0 at once (the strategy cannot stop a machine): it coasts, or your "
        "stop takes over."
    )
    turns = (
        "The sign of `set_speed` reverses it."
        if controller.can_reverse
        else "It runs one way: at a `set_speed` of the other sign the torque is 0."
    )
    reset = (
        "A fault stays until `run` goes from false to true, which is a new start: reset is false, then true."
    )
    return " ".join((text, stops, turns, reset))


def _faults() -> str:
    rows = [[code, FAULTS[code], CAUSES[code]] for code in range(1, len(FAULTS))]
    return (
        "After a fault the torque is 0, or the limit nearest to 0, and stays so.\n\n"
        + table(["`fault`", "name", "what it means"], rows)
        + "\n\n**Lost encoder**: if the drive reports one, hand on NaN as `motor_angle`: the block trips in "
        "the same cycle. If nothing reports it, a stuck or jumping angle trips codes 3 and 4. On any fault "
        "close the brake of a load that can drive the motor: torque 0 does not hold it."
    )


def _cycles(design: Design) -> str:
    return (
        f"The cycle is {1e3 * design.period:.9g} ms. Time is a count of cycles, so nothing adds up over "
        "days. `cycles` is 1 in every call; a call that was left out is reported by 2 in the next one, and "
        f"trips the fault `{FAULTS[2]}`. Jitter of the task does not reach the block; it acts through the "
        "speed, so measure angle and torque at the beginning of the cycle, at a jitter well below it."
    )


def _test(vectors: Vectors, prefix: str, language: str, real: str, figures: Mapping[str, Any]) -> str:
    text = (
        f"`vectors.csv` has {len(vectors.rows)} cycles of {len(vectors.scenarios)} starts in closed loop on "
        f"the exact machine ({', '.join(vectors.scenarios)}), each on a block that begins anew: inputs, and "
        "the torque and fault that must come out. "
    )
    if real == "float64":
        text += "In float64 they are equal to the last bit."
    else:
        text += (
            f"Inputs are rounded to float32; the torque must be within {vectors.room:.3g} N m of what is "
            "expected, or of that of the cycle before or after. "
        )
        off = figures.get("rows_off_float32")
        text += (
            "What is expected is from float64."
            if off is None
            else "What is expected is from this code, compiled here; with the same inputs float64 differs "
            f"by more in {off} cycles, behind a decision that a rounding has moved."
        )
    if language == "c":
        text += f" `make test` compiles and compares them and prints the time of a step (`test_{prefix}.c`)."
    if language == "st":
        text += (
            f" The program `TEST_{prefix}` plays the begin of the first start inside the PLC: run it once "
            "and read `ok`; it needs no file."
        )
    return text


def _figures(figures: Mapping[str, Any], design: Design) -> str:
    period = f"{1e3 * design.period:.9g}"
    rows = [
        ["K_dyn of `softstart simulate`", f"{figures['k_dyn_simulated']:.6g}"],
        ["K_dyn with the rounded parameters", f"{figures['k_dyn_rounded']:.6g}"],
        [f"K_dyn of this block, called every {period} ms", f"{figures['k_dyn_in_cycles']:.6g}"],
        *([f"K_dyn of this code in float32, {name}", f"{value:.6g}"]
          for name, value in figures.get("k_dyn_float32", {}).items()),
        *([label, figures[key]] for key, label in (
            ("state_bytes", "state, bytes"), ("parameter_bytes", "parameters, bytes"),
            ("operations", "operations of a step, at most"),
        ) if key in figures),
    ]  # fmt: skip
    return table(["", "value"], rows)


def _parameters(ready: CompiledController, settings: Sequence[Setting]) -> str:
    meaning = {name: one.meaning for name, one in declared_parameters(ready).items()}
    rows = [
        [
            f"`{one.name}`",
            _value(one.rounded),
            one.unit.replace("*", " "),
            _value(one.exact),
            meaning[one.name],
        ]
        for one in settings
    ]
    text = "Rounded as on the parameter sheet (`softstart report`), which says what they are at an inverter."
    return (
        text + "\n\n" + table(["parameter", "value", "unit", "unrounded", "meaning"], rows)
        if rows
        else "None."
    )


def _value(value: float | str) -> str:
    if isinstance(value, str):
        return show(value.replace("\\", "/").rpartition("/")[2])
    return digits(float(value), 7)


def _provenance(design: Design, origin: str) -> str:
    rows = [
        ["softstart", __version__],
        ["machine", design.machine.name],
        ["strategy", design.name],
        ["command", f"`{origin}`" if origin else "`softstart.export_controller`"],
        ["SHA-256 of all inputs", design.digest()],
    ]
    return table(["", ""], rows)
