"""Whatever takes a machine takes its name, the path of its file and the object; the rest is one sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import softstart
from softstart import Chain, Drive, InputError
from softstart.balancing import Engine
from softstart.clutch import Clutch
from softstart.optimal.problem import Problem

CRANE, CHAIN = Drive.load("crane-4amtkf"), Chain.load("crane-4-mass")

# of each function: a machine by its name, the class that reads it, and figures of the answer
TAKES: dict[str, tuple[str, Any, Callable[[Any], Any]]] = {
    "simulate": ("crane-4amtkf", Drive, lambda one: softstart.simulate(one, "ramp").k_dyn),
    "compare": ("crane-4amtkf", Drive, lambda one: softstart.compare(one, "ramp").rows[0].run.k_dyn),
    "Problem": ("crane-4amtkf", Drive, lambda one: Problem(one, 0.5, base=one, scenarios=(one,)).base_torque),
    "pareto": (
        "crane-4amtkf", Drive,
        lambda one: softstart.pareto(one, [0.45], terminal="synchronous", controllers=[]).points[0].k_dyn,
    ),
    "scenarios_of": ("crane-4amtkf", Drive, lambda one: softstart.scenarios_of(one, gaps=[1.0])[1].gap),
    "linear_view": (
        "crane-4amtkf", Drive, lambda one: softstart.linear_view(one, "ramp", fitted_to=one).kind
    ),
    "natural_vibration": ("crane-4-mass", Chain, lambda one: softstart.natural_vibration(one).Omega.tolist()),
    "reduce_chain": ("crane-4-mass", Chain, lambda one: softstart.reduce_chain(chain=one).J1),
    "verify_on_chain": (
        "crane-4-mass", Chain, lambda one: softstart.verify_on_chain(one, CRANE, "ramp").chain_k_dyn
    ),
    "engage": ("paper-c", Clutch, lambda one: softstart.engage(one).slip_time),
    "balance": ("vaz-11113", Engine, lambda one: softstart.balance(one).tuning_index),
}  # fmt: skip


@pytest.mark.parametrize("name", TAKES)
def test_name_path_and_object_are_the_same(name: str, tmp_path: Path) -> None:
    shipped, kind, figure = TAKES[name]
    machine, path = kind.load(shipped), tmp_path / "own.toml"
    wanted = figure(machine)
    assert figure(shipped) == wanted
    if hasattr(machine, "to_toml"):
        path.write_text(machine.to_toml())
        assert figure(path) == figure(str(path)) == wanted


@pytest.mark.parametrize(
    "name", [*TAKES, "optimize", "tune", "sweep", "report", "parameter_sheet", "identify", "plan_experiments"]
)
def test_anything_else_is_refused_in_one_sentence(name: str) -> None:
    more: dict[str, Callable[[Any], Any]] = {
        "optimize": lambda one: softstart.optimize(one, 0.3),
        "tune": lambda one: softstart.tune(one, "ramp"),
        "sweep": lambda one: softstart.sweep(one, "ramp", {"gap": [0.5, 1.0]}),
        "report": softstart.report,
        "parameter_sheet": lambda one: softstart.parameter_sheet(one, "ramp"),
        "identify": lambda one: softstart.identify([], one),
        "plan_experiments": softstart.plan_experiments,
    }
    call = more[name] if name in more else TAKES[name][2]
    for wrong in (3, None, object(), np.array([1.0]), {"gap": 1.0}):
        with pytest.raises(InputError, match=r"give one .*file") as told:
            call(wrong)
        assert len(told.value.sentences) == 1
    with pytest.raises(InputError, match="no such file"):
        call("nowhere.toml")


def test_a_drive_is_no_chain() -> None:
    for call in (softstart.natural_vibration, softstart.reduce_chain, softstart.two_mass_error):
        with pytest.raises(InputError, match="chain: give one Chain"):
            call(CRANE)


@pytest.mark.parametrize("values", [[0.1, 0.2], np.array([0.1, 0.2]), ["100 ms"], np.array([0.1]), []])
def test_a_parameter_is_a_single_value(values: Any) -> None:
    """A list for one drive is no batch: nothing says how many starts there would be."""
    for call in (
        lambda: softstart.simulate(CRANE, "ramp", parameters={"time": values}),
        lambda: softstart.compare(CRANE, "ramp", parameters={"ramp": {"time": values}}),
        lambda: softstart.engage("paper-c", until=values),
    ):
        with pytest.raises(InputError, match=r"(time|until) = .*(single value|at least one)") as told:
            call()
        assert len(told.value.sentences) == 1
    assert softstart.simulate(CRANE, "ramp", parameters={"time": np.float64(0.1)}).k_dyn > 1.0
    assert softstart.simulate(CRANE, "ramp", parameters={"time": np.array(0.1)}).k_dyn > 1.0


def test_values_of_a_chain_by_any_of_their_words() -> None:
    """As in a file, by the name of a part, and as in Python; bounds that move together move at once."""
    for key in ("mass[1].inertia", "mass[rotor].inertia", "mass_1_inertia", "motor_inertia", "motor.inertia"):
        changed = CHAIN.with_values({key: 0.02})
        assert changed.masses[0].inertia == 0.02
        assert changed.masses[1:] == CHAIN.masses[1:]
    stronger = {"motor.starting_torque": 100.0, "maximum_torque": 120.0}
    for values in (stronger, dict(reversed(stronger.items()))):
        assert asdict(CHAIN.with_values(values).motor) == asdict(
            CHAIN.motor.replace(starting_torque=100.0, maximum_torque=120.0)
        )
    with pytest.raises(InputError) as told:
        CHAIN.with_values({"mass[1].inertai": 1.0, "mass[9].inertia": 1.0, "gap": 0.4})
    first, second = told.value.sentences
    assert "did you mean mass[1].inertia?" in first
    assert "mass[9].inertia" in second


class Found(NamedTuple):
    """What stands for an optimum."""

    gap: float
    theta0: float
    k_dyn: float


def test_equal_scenarios_have_one_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine that is also a scenario: names and machines stay together."""
    module = import_module("softstart.optimal.optimize")
    monkeypatch.setattr(module, "solve", lambda problem: Found(problem.drive.gap, problem.drive.theta0, 1.0))
    worn = CRANE.replace(gap=2.0)
    told = list[str]()
    found = module._alone(Problem(CRANE, 0.5, scenarios=(worn, CRANE, worn)), told.append)
    assert found == {"scenario 1": (0.5, 0.0, 1.0), "scenario 2": (2.0, 0.0, 1.0)}
    assert told == ["scenario 1 alone: K_dyn 1", "scenario 2 alone: K_dyn 1"]
    unknown = worn.replace(load_kind="reactive", start_position="unknown")
    found = module._alone(Problem(unknown, 0.9, scenarios=(CRANE, unknown)), told.append)
    assert found == {
        "scenario 1 driving-flank": (2.0, 1.0, 1.0),
        "scenario 1 mid-gap": (2.0, 0.0, 1.0),
        "scenario 1 opposite-flank": (2.0, -1.0, 1.0),
        "scenario 2": (0.5, 0.0, 1.0),
    }
    assert module._alone(Problem(CRANE, 0.5), told.append) == {"": (0.5, 0.0, 1.0)}
