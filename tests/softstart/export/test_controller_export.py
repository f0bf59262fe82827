"""Exports of strategies without tools of other languages: files, K_dyn, README, refusals, provenance."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from softstart import Command, Drive, InputError, PlainController, make_controller, simulate
from softstart.export.controller import export_controller
from softstart.export.design import design_for
from softstart.export.package import Export

CRANE = Drive.load("crane-4amtkf")
EXPORT = export_controller("take-up", CRANE, "c", origin="softstart export crane-4amtkf")


def text(export: Export, name: str) -> str:
    content = export.files[name]
    assert isinstance(content, str)
    return content


def test_the_files_of_an_export_in_c() -> None:
    assert sorted(EXPORT.files) == [
        "Makefile", "README.md", "take_up.c", "take_up.h", "test_take_up.c", "vectors.csv"
    ]  # fmt: skip
    header = text(EXPORT, "take_up.h")
    assert "void take_up_init(take_up_State *state);" in header
    assert "int run; /* true: run" in header
    assert "stage" not in header.partition("} take_up_Input")[0].rpartition("typedef struct")[2]


def test_all_functions_but_the_interface_are_static() -> None:
    defined = re.findall(r"^(?!static|typedef)\w+ (\w+)\([^;]*\)\n\{", text(EXPORT, "take_up.c"), re.M)
    assert sorted(defined) == ["take_up_init", "take_up_step"]
    assert "malloc" not in text(EXPORT, "take_up.c")


def test_the_block_has_the_k_dyn_of_simulate_with_the_rounded_values() -> None:
    figures = EXPORT.figures
    assert figures["k_dyn_simulated"] == simulate(CRANE, "take-up").k_dyn
    assert figures["k_dyn_in_cycles"] == pytest.approx(figures["k_dyn_rounded"], rel=1e-9)


def test_parameters_are_rounded_to_the_steps_of_the_parameter_sheet() -> None:
    design = design_for(make_controller("ramp", {"time": 0.12345}), CRANE)
    assert design.ready.parameters["time"] == 0.123
    assert design.ready.parameters["full_torque"] != 62.0  # a multiple of 0.1 % of the rated torque
    assert design.ready.parameters["full_torque"] == pytest.approx(62.0, abs=0.5 * 0.001 * 23.9)


def test_the_same_twice_is_the_same_and_no_path_or_time_is_in_it(tmp_path: Path) -> None:
    again = export_controller("take-up", CRANE, "c", tmp_path / "out", origin="softstart export crane-4amtkf")
    assert dict(again.files) == dict(EXPORT.files)
    assert str(tmp_path) not in "".join(map(str, again.files.values()))
    assert (tmp_path / "out/take_up.c").read_text() == text(EXPORT, "take_up.c")


def test_the_readme_says_what_who_connects_it_must_know() -> None:
    readme = text(EXPORT, "README.md")
    words = (
        "rad/s", "2 pi counts", "cycles", "Lost encoder", "encoder stuck", "SHA-256",
        "softstart export crane-4amtkf", "take_up_speed", "operations of a step",
    )  # fmt: skip
    for word in words:
        assert word in readme, word


def test_the_hash_is_of_the_inputs() -> None:
    one, other = (design_for(make_controller("take-up"), drive).digest() for drive in
                  (CRANE, CRANE.replace(gap=1.0)))  # fmt: skip
    assert one in text(EXPORT, "README.md")
    assert one != other


def test_another_cycle_than_the_one_of_the_strategy_is_said() -> None:
    export = export_controller("take-up", CRANE, "c", period="2 ms")
    assert any("designed for a cycle of 1 ms" in note for note in export.notes)
    assert export.notes[0] in text(export, "README.md")


def test_a_strategy_that_is_not_sampled_acts_in_cycles() -> None:
    export = export_controller("direct", CRANE, "c")
    assert any("not sampled" in note for note in export.notes)


def test_a_strategy_with_a_sensor_has_it_as_input() -> None:
    export = export_controller("reduced-first-stage", CRANE, "c", prefix="first")
    assert "first_real stage;" in text(export, "first.h")
    assert (
        "shaft_torque" not in text(export, "first.h").partition("} first_Input")[0].rpartition("typedef")[2]
    )


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_structured_text(real: Any) -> None:
    export = export_controller("ramp", CRANE, "st", real=real)
    assert sorted(export.files) == ["README.md", "ramp.st", "ramp.xml", "vectors.csv"]
    assert "FUNCTION_BLOCK ramp" in text(export, "ramp.st")
    readme = text(export, "README.md")
    assert "TEST_ramp" in readme
    assert ("| `motor_torque` | in | REAL |" in readme) == (real == "float32")
    assert "| `motor_angle` | in | LREAL |" in readme


@dataclass(frozen=True)
class Plain(PlainController):
    name = "plain"

    def step(self, measured: Any, state: Any) -> Command:
        return Command(31.0)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"controller": Plain()}, "plain Python"),
        ({"language": "pascal"}, 'language = "pascal"'),
        ({"real": "float16"}, 'real = "float16"'),
        ({"prefix": "int"}, "keyword"),
        ({"prefix": "end_if"}, "keyword"),
        ({"prefix": "a b"}, "prefix"),
        ({"period": "-1 ms"}, "period"),
    ],
)
def test_refusals(arguments: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence) as error:
        export_controller(**{"controller": "ramp", "drive": CRANE, **arguments})
    assert len(error.value.sentences) == 1
