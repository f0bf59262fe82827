"""An instance of an FMU: the same calls for both versions of FMI."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from softstart.export.fmu import Model, Version, fmu

OLDER = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}


def made(model: Model, version: Version, folder: Path) -> Path:
    """The FMU as a file, which has a binary."""
    file = fmu(model, version)
    assert file.note == ""
    path = folder / f"{model.prefix}-{version}.fmu"
    path.write_bytes(file.content)
    return path


class Instance:
    """An instance, unpacked into a folder of its own; a status that is no success is an exception of fmpy."""

    def __init__(self, path: Path, folder: Path, name: str = "one") -> None:
        self.description = fmpy.read_model_description(str(path))
        self.folder = folder / name
        fmpy.extract(str(path), self.folder)
        self.new = self.description.fmiVersion == "3.0"
        kind = FMU3Slave if self.new else FMU2Slave
        self.fmu: Any = kind(
            guid=self.description.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.variables = {one.name: one for one in self.description.modelVariables}
        self.fmu.instantiate()

    def begin(self, start: float = 0.0) -> Instance:
        """Through the initialization."""
        if self.new:
            self.fmu.enterInitializationMode(startTime=start)
        else:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def get(self, *references: int, kind: str = "Float64") -> list[float]:
        """Values by their references."""
        return list(getattr(self.fmu, f"get{kind if self.new else OLDER[kind]}")(references))

    def set(self, reference: int, value: float, kind: str = "Float64") -> None:
        """A value by its reference."""
        getattr(self.fmu, f"set{kind if self.new else OLDER[kind]}")([reference], [value])

    def __getitem__(self, name: str) -> float:
        variable = self.variables[name]
        kind = variable.type if self.new else {old: new for new, old in OLDER.items()}[variable.type]
        return self.get(variable.valueReference, kind=kind)[0]

    def give(self, values: Mapping[str, float]) -> None:
        """Inputs by name, of real numbers."""
        references = [self.variables[name].valueReference for name in values]
        (self.fmu.setFloat64 if self.new else self.fmu.setReal)(references, list(values.values()))

    def step(self, point: float, length: float) -> Any:
        """One communication step."""
        return self.fmu.doStep(point, length)

    @property
    def state(self) -> Any:
        """A copy of the state."""
        return self.fmu.getFMUState() if self.new else self.fmu.getFMUstate()

    def restore(self, state: Any) -> None:
        """Go back to a state."""
        (self.fmu.setFMUState if self.new else self.fmu.setFMUstate)(state)

    def free(self, state: Any) -> None:
        """Give a state back."""
        (self.fmu.freeFMUState if self.new else self.fmu.freeFMUstate)(state)
