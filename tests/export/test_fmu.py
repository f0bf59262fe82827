"""FMUs of C code whose answers are known: accepted, run and rebuilt by fmpy, for both versions of FMI."""

from __future__ import annotations

import ctypes
import inspect
import io
import math
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import fmpy.build
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from tests.export import tools
from tests.export.blocks import COUNT, TURN
from tests.export.fmu_instance import Instance, made

from softstart.export.fmu import BINARY, Model, Version, fmu

VERSIONS: tuple[Version, ...] = ("2.0", "3.0")
DISCARD, ERROR = 2, 3
RUN, SPEED, ANGLE, TORQUE, FAULT = 1, 2, 3, 4, 5  # value references


@pytest.fixture(params=VERSIONS)
def version(request: pytest.FixtureRequest) -> Version:
    found: Version = request.param
    return found


@pytest.fixture
def count(version: Version, tmp_path: Path) -> Path:
    return made(COUNT, version, tmp_path)


@pytest.fixture
def turn(version: Version, tmp_path: Path) -> Path:
    return made(TURN, version, tmp_path)


def refused(status: int, call: Any, *arguments: Any, **words: Any) -> None:
    with pytest.raises(fmpy.fmi1.FMICallException) as caught:
        call(*arguments, **words)
    assert caught.value.status == status


@pytest.mark.parametrize("model", [COUNT, TURN], ids=lambda model: model.prefix)
def test_valid_without_a_message(model: Model, version: Version, tmp_path: Path) -> None:
    assert validate_fmu(str(made(model, version, tmp_path))) == []


@pytest.mark.parametrize("model", [COUNT, TURN], ids=lambda model: model.prefix)
def test_the_source_compiles_without_a_warning(model: Model, version: Version, tmp_path: Path) -> None:
    fmpy.extract(str(made(model, version, tmp_path)), tmp_path / "fmu")
    units = f"softstart_fmi{version[0]}.c", "softstart_model.c"
    tools.run(
        "gcc", *tools.STRICT, "-Wpedantic", "-O2", "-fPIC", "-c", *units, cwd=tmp_path / "fmu" / "sources"
    )


@pytest.mark.parametrize(("version", "slave"), [("2.0", FMU2Slave), ("3.0", FMU3Slave)])
def test_all_functions_and_nothing_else_are_exported(version: Version, slave: type, tmp_path: Path) -> None:
    path = made(COUNT, version, tmp_path)
    wanted = {name for name, _ in inspect.getmembers(slave) if name.startswith(f"fmi{version[0]}")}
    whole = Path(fmpy.__file__).parent / "c-code" / f"fmi{version[0]}FunctionTypes.h"
    declared = set(re.findall(rf"\b(fmi{version[0]}\w+)TYPE\b", whole.read_text()))
    fmpy.extract(str(path), tmp_path / "fmu")
    said = tools.run("nm", "-D", "--defined-only", tmp_path / "fmu" / BINARY[version] / "count.so")
    exported = {line.split()[-1] for line in said.splitlines()}
    assert wanted <= declared
    assert exported == declared
    assert len(declared) == {"2.0": 44, "3.0": 75}[version]


def test_the_same_model_gives_the_same_bytes(version: Version) -> None:
    first = fmu(COUNT, version).content
    assert fmu(COUNT, version).content == first
    other = fmu(replace(COUNT, readme="# Another\n"), version).content
    assert _token(other) != _token(first)


def _token(content: bytes) -> str:
    with zipfile.ZipFile(io.BytesIO(content)) as opened:
        header = opened.read("sources/softstart_model.h").decode()
    return header.partition("#define MODEL_TOKEN ")[2].partition("\n")[0]


def test_simulated_by_fmpy(count: Path) -> None:
    times = np.arange(6) * COUNT.period
    angles = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    signals = np.array(
        [(t, True, 3.0, angle) for t, angle in zip(times, angles, strict=True)],
        dtype=[("time", float), ("run", bool), ("speed", float), ("angle", float)],
    )
    found = fmpy.simulate_fmu(
        str(count),
        input=signals,
        output=["torque", "fault"],
        stop_time=times[-1],
        output_interval=COUNT.period,
    )
    expected = [0.0, *(np.cumsum(angles)[:5] + 3.0 * np.sqrt(np.arange(1, 6)))]
    assert found["torque"].tolist() == pytest.approx(expected, abs=0.0, rel=1e-15)
    assert not found["fault"].any()


def test_a_machine_simulated_by_fmpy(turn: Path) -> None:
    found = fmpy.simulate_fmu(
        str(turn), output=["motor_angle", "motor_speed"], start_values={"torque": 2.0}, stop_time=0.5,
        output_interval=0.1,
    )  # fmt: skip
    assert found["motor_angle"] == pytest.approx(0.25 + found["time"] ** 2, rel=1e-14)
    assert found["motor_speed"] == pytest.approx(2.0 * found["time"], abs=1e-14)


def test_a_machine_can_end_the_simulation(turn: Path, tmp_path: Path) -> None:
    one = Instance(turn, tmp_path).begin()
    if one.new:
        assert not one.step(0.0, 0.5)[1]
        assert one.step(0.5, 0.5)[1]
        return
    one.step(0.0, 0.5)
    refused(DISCARD, one.step, 0.5, 0.5)
    terminated, last = ctypes.c_int(), ctypes.c_double()
    one.fmu.fmi2GetBooleanStatus(one.fmu.component, 3, ctypes.byref(terminated))
    one.fmu.fmi2GetRealStatus(one.fmu.component, 2, ctypes.byref(last))
    assert (terminated.value, last.value) == (1, 1.0)


def test_built_again_from_its_sources(count: Path, version: Version, tmp_path: Path) -> None:
    assert tools.path_of("cmake"), "cmake is missing: install it to run this test"
    folder = tmp_path / "fmu"
    fmpy.extract(str(count), folder)
    library = folder / BINARY[version] / "count.so"
    library.unlink()
    (tmp_path / "build").mkdir()
    fmpy.build.build_platform_binary(folder, tmp_path / "build", all_warnings=True)
    assert library.exists()
    found = fmpy.simulate_fmu(str(folder), stop_time=0.01, output_interval=COUNT.period)
    assert found["torque"][-1] == pytest.approx(2.0 * math.sqrt(5))


def test_two_instances_share_nothing(count: Path, tmp_path: Path) -> None:
    one, two = (Instance(count, tmp_path, name).begin() for name in ("one", "two"))
    one.set(ANGLE, 5.0)
    for number in range(3):
        one.step(number * COUNT.period, COUNT.period)
    two.step(0.0, COUNT.period)
    assert one.get(TORQUE) == [15.0 + 2.0 * math.sqrt(3)]
    assert two.get(TORQUE) == [2.0]
    one.fmu.terminate()
    one.fmu.freeInstance()
    two.step(COUNT.period, COUNT.period)
    assert two.get(TORQUE, SPEED) == [2.0 * math.sqrt(2), 2.0]


def test_start_values_and_reset(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path).begin(start=7.0)
    assert one.get(0, SPEED, ANGLE, TORQUE) == [7.0, 2.0, 0.0, 0.0]
    assert one.get(RUN, kind="Boolean") == [True]
    one.set(SPEED, 9.0)
    one.set(RUN, False, kind="Boolean")
    one.step(7.0, COUNT.period)
    assert one.get(0, TORQUE) == [7.0 + COUNT.period, 9.0]
    one.fmu.reset()
    one.begin()
    assert one.get(0, SPEED, TORQUE) == [0.0, 2.0, 0.0]
    assert one.get(RUN, kind="Boolean") == [True]


def test_a_missed_sample_is_counted(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path).begin()
    one.step(0.0, 2 * COUNT.period)
    assert one.get(FAULT, kind="Int32") == [0]
    one.step(2 * COUNT.period, COUNT.period)
    assert one.get(FAULT, kind="Int32") == [2]
    assert one.get(TORQUE) == [2.0 * math.sqrt(3)]


@pytest.mark.parametrize("length", [0.0, -0.002, 0.001, 0.003, 0.0025, math.nan, math.inf])
def test_a_refused_step_changes_nothing(count: Path, tmp_path: Path, length: float) -> None:
    one, two = (Instance(count, tmp_path, name).begin() for name in ("one", "two"))
    for each in (one, two):
        each.step(0.0, COUNT.period)
    refused(DISCARD, one.step, COUNT.period, length)
    assert one.get(0, TORQUE) == two.get(0, TORQUE) == [COUNT.period, 2.0]
    for each in (one, two):
        each.step(COUNT.period, COUNT.period)
    assert one.get(TORQUE) == two.get(TORQUE)


def test_communication_points_follow_one_another(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path).begin()
    time = 0.0
    for _ in range(1000):  # a sum of steps, with its rounding
        one.step(time, COUNT.period)
        time += COUNT.period
    refused(ERROR, one.step, 1001 * COUNT.period, COUNT.period)
    refused(ERROR, one.step, math.nan, COUNT.period)
    one.step(1000 * COUNT.period, COUNT.period)
    assert one.get(TORQUE) == [2.0 * math.sqrt(1001)]


def test_steps_of_a_machine_are_as_long_as_wanted(turn: Path, tmp_path: Path) -> None:
    one = Instance(turn, tmp_path).begin()
    one.set(1, 2.0)
    assert one.get(2, 3) == [0.25, 0.0]  # before the first step
    time = 0.0
    for length in (0.1, 0.003, 0.02, 1e-9, 0.25):
        one.step(time, length)
        time += length
    assert one.get(2) == pytest.approx([0.25 + time**2], rel=1e-14)
    refused(DISCARD, one.step, time, 0.0)


def test_wrong_calls_are_refused(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path)
    refused(ERROR, one.step, 0.0, COUNT.period)  # before the initialization
    one.begin()
    for call, arguments in (
        (one.get, (6,)),  # no such variable
        (one.get, (RUN,)),  # of another type
        (one.set, (TORQUE, 1.0)),  # an output
        (one.set, (0, 1.0)),  # the time
        (one.set, (FAULT, 1.0)),
    ):
        refused(ERROR, call, *arguments)
    refused(ERROR, one.get, SPEED, kind="Int32")
    refused(ERROR, one.fmu.exitInitializationMode)
    one.fmu.terminate()
    assert one.get(SPEED) == [2.0]
    refused(ERROR, one.set, SPEED, 1.0)
    refused(ERROR, one.step, 0.0, COUNT.period)


def test_a_call_with_a_wrong_reference_sets_nothing(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path).begin()
    setter = one.fmu.setFloat64 if one.new else one.fmu.setReal
    refused(ERROR, setter, [SPEED, TORQUE], [8.0, 8.0])
    assert one.get(SPEED) == [2.0]


def test_another_token_is_refused(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path)
    one.fmu.guid = one.fmu.guid.replace("-", "+")
    with pytest.raises(Exception, match="nstantiate"):
        one.fmu.instantiate()


def test_the_state_can_be_kept_and_restored(count: Path, tmp_path: Path) -> None:
    one = Instance(count, tmp_path).begin()
    one.set(ANGLE, 1.5)
    one.step(0.0, COUNT.period)
    kept, before = one.state, one.get(0, ANGLE, TORQUE)
    one.set(ANGLE, -3.0)
    one.step(COUNT.period, COUNT.period)
    after = one.get(0, ANGLE, TORQUE)
    one.restore(kept)
    assert one.get(0, ANGLE, TORQUE) == before
    one.set(ANGLE, -3.0)
    one.step(COUNT.period, COUNT.period)
    assert one.get(0, ANGLE, TORQUE) == after
    one.free(kept)


def test_a_state_goes_through_bytes_into_another_instance(count: Path, tmp_path: Path) -> None:
    one, two = (Instance(count, tmp_path, name).begin() for name in ("one", "two"))
    one.set(ANGLE, 1.5)
    one.step(0.0, COUNT.period)
    words = (
        ("serializeFMUState", "deserializeFMUState")
        if one.new
        else ("serializeFMUstate", "deSerializeFMUstate")
    )
    written = getattr(one.fmu, words[0])(one.state)
    two.restore(getattr(two.fmu, words[1])(written))
    assert two.get(0, ANGLE, TORQUE) == one.get(0, ANGLE, TORQUE)
    refused(ERROR, getattr(two.fmu, words[1]), written[:-1])


def test_without_memory_errors(version: Version, tmp_path: Path) -> None:
    """The whole life of two instances, and states of them, under the sanitizers of gcc."""
    fmpy.extract(str(made(COUNT, version, tmp_path)), tmp_path / "fmu")
    sources = tmp_path / "fmu" / "sources"
    (sources / "main.c").write_text(MAIN[version])
    flags = [*tools.STRICT, "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    tools.run("gcc", *flags, "main.c", "softstart_model.c", "-o", "main", "-lm", cwd=sources)
    assert tools.run(sources / "main") == "torque 4.82842712\n"


LIFE = """
    for (int i = 0; i < 2; i++) { STEP(one, i * 0.002); }
    void *state = NULL;
    GET_STATE(one, &state);
    STEP(one, 0.004);
    SET_STATE(two, state);
    FREE_STATE(one, &state);
    uint32_t reference = 4;
    double torque;
    STEP(two, 0.004);
    GET(two, &reference, &torque);
    FREE(one);
    FREE(two);
    printf("torque %.8f\\n", torque + 2.0 * sqrt(2.0) - 2.0 * sqrt(3.0) + 2.0);
    return 0;
}
"""
MAIN = {
    "2.0": """#include "softstart_fmi2.c"
#define STEP(instance, time) fmi2DoStep(instance, time, 0.002, 1)
#define GET_STATE fmi2GetFMUstate
#define SET_STATE fmi2SetFMUstate
#define FREE_STATE fmi2FreeFMUstate
#define FREE fmi2FreeInstance
#define GET(instance, reference, value) fmi2GetReal(instance, reference, 1, value)
static Instance *new_one(const Callbacks *callbacks)
{
    Instance *one = fmi2Instantiate("one", CO_SIMULATION, MODEL_TOKEN, "", callbacks, 0, 1);
    fmi2SetupExperiment(one, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(one);
    fmi2ExitInitializationMode(one);
    return one;
}
int main(void)
{
    const Callbacks callbacks = {NULL, calloc, free, NULL, NULL};
    Instance *one = new_one(&callbacks), *two = new_one(&callbacks);
""" + LIFE,
    "3.0": """#include "softstart_fmi3.c"
static double last;
static bool flags[3];
#define STEP(instance, time) fmi3DoStep(instance, time, 0.002, true, flags, flags + 1, flags + 2, &last)
#define GET_STATE fmi3GetFMUState
#define SET_STATE fmi3SetFMUState
#define FREE_STATE fmi3FreeFMUState
#define FREE fmi3FreeInstance
#define GET(instance, reference, value) fmi3GetFloat64(instance, reference, 1, value, 1)
static Instance *new_one(void)
{
    Instance *one = fmi3InstantiateCoSimulation(
        "one", MODEL_TOKEN, "", false, true, false, false, NULL, 0, NULL, NULL, NULL);
    fmi3EnterInitializationMode(one, false, 0.0, 0.0, false, 0.0);
    fmi3ExitInitializationMode(one);
    return one;
}
int main(void)
{
    Instance *one = new_one(), *two = new_one();
""" + LIFE,
}  # fmt: skip
