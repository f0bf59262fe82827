"""FMUs without any tool of others: their files, and what is said where no binary can be made."""

from __future__ import annotations

import io
import platform
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from softstart.export import fmu as module
from softstart.export.fmu import Model, Signal, Version, fmu

MODEL = Model(
    "gentle <start>",
    "gentle",
    (Signal("run", "truth", start=1.0), Signal("motor_speed", "real", "rad/s", "measured", 1.5)),
    (Signal("torque", "real", "N m", "demand"), Signal("fault", "whole")),
    {"gentle.h": "typedef int gentle_Input;\n", "gentle.c": '#include "gentle.h"\n'},
    "# Gentle <start>\n",
    period=0.001,
)


def opened(content: bytes) -> dict[str, str]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_without_a_compiler_there_are_the_sources(version: Version) -> None:
    made = fmu(MODEL, version)
    if platform.system() == "Linux":
        assert made.note.startswith("The FMU has sources only: no C compiler was found (gcc, cc or clang")
    files = opened(made.content)
    source = f"softstart_fmi{version[0]}.c"
    wanted = {
        "modelDescription.xml", "documentation/README.md", "documentation/index.html", "sources/gentle.h",
        "sources/gentle.c", "sources/softstart_model.h", "sources/softstart_fmu.c",
        "sources/softstart_model.c", f"sources/{source}",
    }  # fmt: skip
    assert set(files) == wanted | ({"sources/buildDescription.xml"} if version == "3.0" else set())
    assert next(iter(files)) == "modelDescription.xml"
    assert "# Gentle &lt;start&gt;" in files["documentation/index.html"]
    listed = files["modelDescription.xml" if version == "2.0" else "sources/buildDescription.xml"]
    assert f'name="{source}"' in listed


@pytest.mark.usefixtures("no_compiler")
def test_the_token_depends_on_all_that_is_inside(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    def token(model: Model, version: Version = "2.0") -> str:
        root = ElementTree.fromstring(opened(fmu(model, version).content)["modelDescription.xml"])
        return root.attrib["guid" if version == "2.0" else "instantiationToken"]

    tokens = [
        token(MODEL), token(MODEL, "3.0"), token(replace(MODEL, period=0.002)),
        token(replace(MODEL, sources={**MODEL.sources, "gentle.h": "\n"})),
        token(replace(MODEL, inputs=(MODEL.inputs[0], replace(MODEL.inputs[1], start=2.0)))),
    ]  # fmt: skip
    assert len(set(tokens)) == len(tokens)
    assert token(MODEL) == tokens[0]
    assert fmu(MODEL, "3.0").content == fmu(MODEL, "3.0").content


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize(("version", "unknown"), [("2.0", "Unknown"), ("3.0", "Output")])
def test_variables_and_structure(version: Version, unknown: str) -> None:
    root = ElementTree.fromstring(opened(fmu(MODEL, version).content)["modelDescription.xml"])
    interface = root.find("CoSimulation")
    assert interface is not None
    assert interface.attrib["canHandleVariableCommunicationStepSize"] == "false"
    variables = list(root.iterfind("ModelVariables/*"))
    assert [one.attrib["name"] for one in variables] == ["time", "run", "motor_speed", "torque", "fault"]
    assert [int(one.attrib["valueReference"]) for one in variables] == [0, 1, 2, 3, 4]
    merged = [one.attrib | (one[0].attrib if len(one) else {}) for one in variables]
    assert [one.get("start") for one in merged] == [None, "true", "1.5", None, None]
    assert merged[2]["unit"] == "rad/s"
    assert merged[3]["unit"] == "N.m"
    assert [one["variability"] for one in merged] == [
        "continuous", "discrete", "continuous", "discrete", "discrete"
    ]  # fmt: skip
    assert len(list(root.iter(unknown))) == {"2.0": 4, "3.0": 2}[version]
    machine = Model("m", "m", (), (Signal("motor_angle", "double", "rad"),), {"m.c": ""}, "")
    text = opened(fmu(machine, version).content)["modelDescription.xml"]
    assert 'canHandleVariableCommunicationStepSize="true"' in text
    assert text.count("continuous") == 2


def test_the_header_says_how_the_code_is_called() -> None:
    text = module.model_header(MODEL, "a-token")
    assert '#include "gentle.h"' in text
    assert '#define MODEL_SOURCE "gentle.c"' in text
    assert '#define MODEL_TOKEN "a-token"' in text
    assert "(memory)->input.cycles = (memory)->cycles" in text
    assert "{KIND_TRUTH, SIDE_INPUT, offsetof(gentle_Input, run), 1.0}, /* 1 */" in text
    assert "{KIND_WHOLE, SIDE_OUTPUT, offsetof(gentle_Output, fault), 0.0}, /* 4 */" in text


@pytest.mark.skipif(platform.system() != "Linux", reason="binaries are made on Linux")
def test_a_compiler_that_fails_is_quoted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler = tmp_path / "compiler"
    compiler.write_text("#!/bin/sh\necho 'gentle.c:1: error: no such thing' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", f"{compiler} -m64")
    made = fmu(MODEL, "2.0")
    assert made.note.endswith("could not compile them: gentle.c:1: error: no such thing")
    assert not any(name.startswith("binaries") for name in opened(made.content))
    monkeypatch.setenv("CC", "no-such-compiler -O3")
    note = fmu(MODEL, "2.0").note
    assert note == "The FMU has sources only: CC names no-such-compiler, which is not there."


@pytest.mark.skipif(platform.system() != "Linux", reason="binaries are made on Linux")
def test_elsewhere_there_are_the_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    assert "binaries are made on 64-bit Linux" in fmu(MODEL, "2.0").note
