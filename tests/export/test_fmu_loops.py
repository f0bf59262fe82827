"""FMUs of machines and strategies, coupled as a simulator couples them: the same start as `simulate`."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from tests.export.fmu_instance import Instance, made

from softstart import Chain, Drive, TorqueProfile, simulate
from softstart.controller import Controller, make_controller
from softstart.drive.machine import Machine
from softstart.export import drive
from softstart.export.drive import export_drive
from softstart.export.fmu import Version
from softstart.export.fmu_models import block_model, machine_model
from softstart.export.vectors import run_in_cycles
from softstart.plugins import CONTROLLERS, registered
from softstart.start.block import ControlBlock, control_block
from softstart.start.kernel_input import kernel_input
from softstart.start.run import Run

CRANE = Drive.load("crane-4amtkf")
CASES: dict[str, tuple[Machine, str]] = {
    "crane": (CRANE, "pulse-coast-hold"),
    "worn": (CRANE.replace(gap=1.3, encoder_lines=1024.0, torque_lag=0.002), "pulse-coast-hold"),
    "hoist": (Drive.load("hoist-15kw"), "pulse-coast-hold"),
    # hard impacts in several gaps enlarge rounding: with pulse-coast-hold 2e-16 becomes 4e-10
    "chain": (Chain.load("crane-4-mass"), "take-up"),
    "tractor": (Chain.load("tractor-like"), "s-curve"),
}
WIRES = ("motor_angle", "motor_speed", "motor_torque", "stage", "shaft_torque", "load_speed")
SAME = 1e-12  # of the largest shaft torque
VERSIONS: tuple[Version, ...] = ("2.0", "3.0")


def controller_of(name: str) -> Controller:
    """A strategy by its name."""
    profile = TorqueProfile([0.0, 0.1, 0.3, 2.0], [20.0, 20.0, 60.0, 62.0])
    return make_controller(name, {"profile": profile} if name == "profile" else None)


def coupled(machine: Instance, block: Instance, period: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times after each step, and the shaft torque there; the last step ends with the start."""
    times, torques = [], []
    known = [name for name in WIRES if name in block.variables]
    for sample in range(int(np.ceil(end / period))):
        time = sample * period
        block.give({name: machine[name] for name in known})
        block.step(time, period)
        machine.give({"torque": block["torque"]})
        length = min(period, end - time)
        machine.step(time, length)
        times.append(time + length)
        torques.append(machine["shaft_torque"])
    assert block["fault"] == machine["status"] == 0
    return np.array(times), np.array(torques)


def same_start(machine: Instance, block: Instance, controlled: ControlBlock, run: Run) -> None:
    """The start of the coupled FMUs is this one."""
    times, torques = coupled(machine, block, controlled.period, float(run.end_time))
    given = kernel_input(run.drive)
    sign = 1.0 if given.machine.motor <= given.motor_shaft else -1.0
    expected = sign * np.array([run.at(time)["torques"][given.motor_shaft] for time in times])
    largest = float(run.k_dyn * run.base_torque)
    assert np.abs(torques - expected).max() <= SAME * largest
    assert machine["peak_shaft_torque"] == pytest.approx(largest, rel=SAME)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", CASES)
def test_a_machine_and_its_strategy(name: str, version: Version, tmp_path: Path) -> None:
    machine, strategy = CASES[name]
    controlled = control_block(make_controller(strategy), machine.design_drive)
    models = (
        machine_model(machine, "plant", "# Plant\n"),
        block_model(controlled, "block", "block", "# Block\n"),
    )
    files = [made(model, version, tmp_path) for model in models]
    assert [validate_fmu(str(file)) for file in files] == [[], []]
    plant, block = (Instance(file, tmp_path, file.stem).begin() for file in files)
    run = run_in_cycles(machine, control_block(make_controller(strategy), machine.design_drive))
    same_start(plant, block, controlled, run)
    if name in ("crane", "worn"):  # elsewhere the strategy changes its demand within a cycle
        assert run.k_dyn == pytest.approx(simulate(machine, strategy).k_dyn, rel=SAME)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", CASES)
def test_an_exported_machine_meets_its_vectors(name: str, version: Version, tmp_path: Path) -> None:
    export = export_drive(CASES[name][0], prefix="machine")
    assert export.notes == ()
    path = tmp_path / f"machine_{drive.VERSIONS[version]}.fmu"
    path.write_bytes(bytes(export.files[path.name]))
    assert validate_fmu(str(path)) == []
    head, *lines = str(export.files["vectors.csv"]).splitlines()
    names = head.split(",")
    expected = np.array([[float(one) for one in line.split(",")] for line in lines])
    machine = Instance(path, tmp_path).begin()
    found = [[machine[one] for one in names[2:]]]
    for (time, *_), (_, torque, *_) in itertools.pairwise(expected):
        machine.give({"torque": torque})
        machine.step(time, drive.STEP)
        found.append([machine[one] for one in names[2:]])
    off = np.abs(np.array(found) - expected[:, 2:]).max(0) / np.abs(expected[:, 2:]).max(0).clip(1e-300)
    assert off.max() <= drive.SAME


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(machine_model(CRANE, "plant", "# Plant\n"), "3.0", tmp_path_factory.mktemp("plant"))


@pytest.mark.parametrize("name", sorted(registered(CONTROLLERS)))
def test_every_strategy_on_the_crane(name: str, plant: Path, tmp_path: Path) -> None:
    """In cycles, as a PLC calls it."""
    controlled = control_block(controller_of(name), CRANE)
    model = block_model(controlled, name.replace("-", "_"), name, "# Block\n")
    older = made(model, "2.0", tmp_path)
    assert validate_fmu(str(older)) == []
    run = run_in_cycles(CRANE, control_block(controller_of(name), CRANE))
    for number, path in enumerate((older, made(model, "3.0", tmp_path))):
        machine = Instance(plant, tmp_path, f"plant{number}").begin()
        same_start(machine, Instance(path, tmp_path, f"block{number}").begin(), controlled, run)
