"""An exact machine as FMU: `export_drive`."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from softstart import __version__
from softstart.chain.machines import MachineLike, as_machine
from softstart.drive.machine import Machine
from softstart.export.code import KEYWORDS
from softstart.export.fmu import Version, about, find_compiler, fmu
from softstart.export.fmu_models import machine_model
from softstart.export.machine import endless
from softstart.export.package import MARK, README, Export, check_folder, check_prefix, prefix_of, write_files
from softstart.kernel import records as rec
from softstart.kernel import start
from softstart.kernel.plant import PLANT_INPUT, PLANT_OUTPUT, move_machine

VERSIONS: dict[Version, str] = {"2.0": "fmi2", "3.0": "fmi3"}
STEP = 0.001  # s, of the vectors
MOST, TAIL = 4000, 50  # steps of the vectors: at most, and after the target speed
SAME = 1e-9  # by how much results may differ from the vectors, of the largest


def export_drive(
    machine: MachineLike, folder: str | Path | None = None, *, prefix: str = "", origin: str = ""
) -> Export:
    """Write an exact machine as FMU, for FMI 2.0 and 3.0: what a simulator couples a strategy with.

    Inside is the kernel that `simulate` uses, in C, with the numbers of the machine; no Python. Its input is
    the torque demand, its outputs are what encoder and motor measure, and what only a simulation knows.

    Parameters
    ----------
    machine : the drive or chain, which begins at one position of its gap.
    folder : where the files go; one that an export has written is replaced. None writes nothing.
    prefix : of all names in the code; by default the name of the machine.
    origin : the command that is named in the README.

    Returns
    -------
    The FMUs, vectors of a start with the starting torque, a README, and notes.

    Raises
    ------
    InputError
        For a drive whose position in the gap is unknown, a prefix that is no name, or a folder with other
        files in it.

    Examples
    --------
    >>> export = export_drive("crane-4amtkf", prefix="crane")
    >>> sorted(export.files)
    ['README.md', 'crane_fmi2.fmu', 'crane_fmi3.fmu', 'vectors.csv']
    """
    known = as_machine(machine)
    if folder is not None:
        check_folder(folder)
    chosen = check_prefix(prefix or prefix_of(known.name), KEYWORDS)
    model = machine_model(known, chosen, _readme(known, chosen, origin))
    files: dict[str, str | bytes] = {
        f"{chosen}_{name}.fmu": fmu(model, version).content for version, name in VERSIONS.items()
    }
    files |= {"vectors.csv": vectors(known), README: f"{model.readme}\n{about(model)}"}
    note = find_compiler()[1]
    export = Export(chosen, "fmu", "float64", files, {}, (note,) if note else ())
    if folder is None:
        return export
    write_files(folder, export.files)
    return replace(export, folder=str(folder))


def vectors(machine: Machine) -> str:
    """A start with the starting torque, step by step: time, torque and the outputs at the end of the step.

    >>> from softstart import Drive
    >>> vectors(Drive.load("crane-4amtkf")).splitlines()[0]
    'time,torque,motor_angle,motor_speed,motor_torque,shaft_torque,load_speed,stage,gap,peak_shaft_torque,reached,status'
    """
    given = endless(machine)
    work, nothing = np.zeros(rec.N_WORK), np.zeros((0, 1))
    start.begin(work, *given.first, float(given.machine.time_limit), False)
    measured, row, output = (np.zeros(rec.size(one)) for one in (rec.MEASURED, PLANT_INPUT, PLANT_OUTPUT))
    row[0] = machine.design_drive.Ms
    names = tuple(PLANT_OUTPUT.names or ())
    lines, left = [",".join(("time", "torque", *names))], TAIL
    for number in range(MOST):
        move_machine(work, given.tones, nothing, measured, row, output, STEP if number else 0.0)
        numbers = (repr(float(one)) for one in (number * STEP, row[0], *output))
        lines.append(",".join(numbers))
        left -= int(output[names.index("reached")])
        if left == 0:
            break
    return "\n".join(lines) + "\n"


def _readme(machine: Machine, prefix: str, origin: str) -> str:
    """What one who uses the FMU must know, in Markdown."""
    digest = hashlib.sha256(json.dumps([__version__, machine.to_toml()]).encode()).hexdigest()
    command = f"`{origin}`" if origin else "`softstart.export_drive`"
    return f"""\
# {prefix}: {machine.name}

{MARK}

The exact machine: motor with its torque limits, slew limit, lag and encoder, shafts with backlash and
stiffness, load with its friction. Between impacts the motion is solved exactly; nothing depends on a step
size or a tolerance. All angles, speeds and torques are those at the motor shaft.

`{prefix}_fmi2.fmu` is for FMI 2.0, `{prefix}_fmi3.fmu` for FMI 3.0; both are for co-simulation and hold the
sources in C99.

Hold the torque demand of a controller over its period, and give it `motor_angle`, `motor_speed` and
`motor_torque` at the begin of the next one. `peak_shaft_torque`, divided by the base torque of the machine,
is K_dyn. The motion has no end: `reached` tells that the load has had its target speed.

## Test

`vectors.csv` has a start with the starting torque in steps of {1e3 * STEP:g} ms: torque demand, and the
outputs at the end of the step. They are met within {SAME:g} of the largest value of each column.

## Machine

```toml
{machine.to_toml().strip()}
```

## Provenance

| | |
|---|---|
| softstart | {__version__} |
| command | {command} |
| SHA-256 of all inputs | {digest} |
"""
