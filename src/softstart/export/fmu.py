"""FMUs: C code of a controller or a machine, as simulators load it (co-simulation of FMI 2.0 and 3.0).

The functions of the standard are C files beside this module (`fmi/`), the same in every FMU; what differs is
in a generated header. The same model gives the same bytes: no dates, and a token that is a hash of all else.
"""

from __future__ import annotations

import hashlib
import html
import io
import os
import platform
import re
import shlex
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

from softstart import __version__
from softstart.export.statements import Kind, Struct

Version = Literal["2.0", "3.0"]
COMPILERS = ("gcc", "cc", "clang")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-s")
BINARY = {"2.0": "binaries/linux64", "3.0": "binaries/x86_64-linux"}  # folder, by version of FMI
TYPES: dict[str, dict[Kind, str]] = {
    "2.0": {"real": "Real", "double": "Real", "whole": "Integer", "truth": "Boolean"},
    "3.0": {"real": "Float64", "double": "Float64", "whole": "Int32", "truth": "Boolean"},
}
# units of signals as Modelica writes them, with the exponents of SI units
UNITS: dict[str, tuple[str, dict[str, str]]] = {
    "s": ("s", {"s": "1"}),
    "rad": ("rad", {"rad": "1"}),
    "rad/s": ("rad/s", {"s": "-1", "rad": "1"}),
    "N m": ("N.m", {"kg": "1", "m": "2", "s": "-2"}),
}


@dataclass(frozen=True)
class Signal:
    """An input or output of the C code; the name is that of its member."""

    name: str
    kind: Kind = "real"
    unit: str = ""  # "" or a key of `UNITS`
    description: str = ""
    start: float = 0.0  # of an input


@dataclass(frozen=True)
class Model:
    """C code with its signals.

    Parameters
    ----------
    name : shown to users.
    prefix : of the C code: `sources` have PREFIX.c, with `PREFIX_State`, `PREFIX_Input`, `PREFIX_Output`, and
        `PREFIX_init(state)`.
    inputs, outputs : in the order of the value references, from 1 on.
    sources : file name to text, PREFIX.c among them, which includes the others.
    readme : documentation, Markdown.
    period : s. Of a controller, `PREFIX_step(state, input, output)`: communication steps are whole multiples
        of it, and the input `cycles`, which is no signal, counts them. 0 for a machine, `PREFIX_step(state,
        input, output, h)`, with steps h of any length; one of 0 gives the outputs and changes nothing.
    step, stop_time : suggested to simulators, s.
    ended : a truth among the outputs that ends the simulation, or "".
    """

    name: str
    prefix: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    sources: Mapping[str, str]
    readme: str
    period: float = 0.0
    step: float = 0.001
    stop_time: float = 1.0
    ended: str = ""

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Inputs, then outputs."""
        return self.inputs + self.outputs


def signals(struct: Struct, starts: Mapping[str, float] | None = None) -> tuple[Signal, ...]:
    """The members of a structure of the C code as signals, but for `cycles`.

    A unit stands alone between commas or semicolons of the comment of the member.

    >>> from softstart.export.statements import Member, Struct
    >>> members = Member("speed", "real", "of the motor, rad/s"), Member("cycles", "whole", "1 normally")
    >>> signals(Struct("Input", members), {"speed": 2.0})
    (Signal(name='speed', kind='real', unit='rad/s', description='of the motor', start=2.0),)
    """
    found = []
    for member in struct.members:
        if member.name == "cycles":
            continue
        parts = re.split("[,;] ", member.comment)
        unit = next((part for part in parts if part in UNITS), "")
        description = ", ".join(part for part in parts if part != unit)
        assert isinstance(member.type, str), f"{member.name}: a signal is a number"
        found.append(
            Signal(member.name, member.type, unit, description, (starts or {}).get(member.name, 0.0))
        )
    return tuple(found)


@dataclass(frozen=True)
class FmuFile:
    """The bytes of an FMU, and why it has no binary, "" if it has one."""

    content: bytes
    note: str


def fmu(model: Model, version: Version) -> FmuFile:
    """The FMU of a model, for a version of FMI.

    Without a C compiler, or elsewhere than on 64-bit Linux, it has the sources only; the note says so.
    """
    units = (f"softstart_fmi{version[0]}.c", "softstart_model.c")  # what is compiled
    folder = resources.files("softstart.export") / "fmi"
    readme = f"{model.readme}\n{about(model)}"
    files = {
        **{f"sources/{name}": text for name, text in model.sources.items()},
        **{
            f"sources/{name}": (folder / name).read_text(encoding="utf-8")
            for name in ("softstart_fmu.c", *units)
        },
        "documentation/README.md": readme,
        "documentation/index.html": _page(model, readme),
    }
    token = _token(model, version, files)
    files["sources/softstart_model.h"] = model_header(model, token)
    if version == "2.0":
        files["modelDescription.xml"] = description_2(model, token, units)
    else:
        files["modelDescription.xml"] = description_3(model, token)
        files["sources/buildDescription.xml"] = build_description(model, units)
    contents = {name: text.encode() for name, text in files.items()}
    compiler, note = find_compiler()
    if compiler:
        sources = {
            name.removeprefix("sources/"): text for name, text in files.items() if name.startswith("sources/")
        }
        binary, note = compiled(compiler, sources, units)
        if binary:
            contents[f"{BINARY[version]}/{model.prefix}.so"] = binary
    return FmuFile(packed(contents), note)


def _token(model: Model, version: Version, files: Mapping[str, str]) -> str:
    """A hash of all that the FMU is made of."""
    whole = hashlib.sha256(repr((version, __version__, model)).encode())
    for name, text in sorted(files.items()):
        whole.update(f"{name}\0{text}\0".encode())
    return str(uuid.uuid5(uuid.NAMESPACE_URL, whole.hexdigest()))


def about(model: Model) -> str:
    """The section of the documentation that says how a simulator uses the FMU."""
    lines = ["## As an FMU", ""]
    if model.period:
        lines += [
            f"The communication step is {model.period!r} s, the period of the control. In each step the",
            "inputs as they are at its begin are sampled, and the outputs change. A longer step, a whole",
            "multiple of the period, stands for missed samples; another one is refused. A simulator that",
            "hands outputs on only after the step of all FMUs adds a dead time of one period.",
        ]
    else:
        lines += [
            "Communication steps have any length above 0; the inputs are held over a step. The solution does",
            "not depend on the steps, but for the instants at which the inputs change.",
        ]
    if model.ended:
        lines += [f"The simulation ends when `{model.ended}` becomes true."]
    lines += [
        "The state can be saved, restored and serialised.",
        "",
        "| variable | causality | unit | meaning |",
    ]
    lines += ["|---|---|---|---|"]
    for number, signal in enumerate(model.signals):
        side = "input" if number < len(model.inputs) else "output"
        described = signal.description.replace("|", "\\|")
        start = f" (start value {_start(signal)})" if side == "input" else ""
        lines.append(f"| `{signal.name}` | {side} | {signal.unit} | {described}{start} |")
    return "\n".join(lines) + "\n"


def _page(model: Model, readme: str) -> str:
    """The page that simulators show as documentation."""
    name = html.escape(model.name)
    head = f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{name}</title></head>\n'
    return f"{head}<body><pre>\n{html.escape(readme)}</pre></body></html>\n"


def model_header(model: Model, token: str) -> str:
    """`softstart_model.h`: what the functions of FMI must know of the C code."""
    of = model.prefix
    length = "" if model.period else ", length"
    call = f"{of}_step(&(memory)->state, &(memory)->input, &(memory)->output{length})"
    rows = []
    for number, signal in enumerate(model.signals, 1):
        side = "Input" if number <= len(model.inputs) else "Output"
        kind = {"whole": "KIND_WHOLE", "truth": "KIND_TRUTH"}.get(
            signal.kind, f"KIND_OF({of}_{side}, {signal.name})"
        )
        place = f"offsetof({of}_{side}, {signal.name})"
        rows.append(f"    {{{kind}, SIDE_{side.upper()}, {place}, {_number(signal.start)}}}, /* {number} */")
    if model.period:
        first = "((void)(memory))"
        step = f"((memory)->input.cycles = (memory)->cycles, (void)(length), {call})"
    else:
        first, step = call.replace(length, ", 0.0"), call
    return "".join(
        (
            f"/* Names and signals of {of}; generated. */\n",
            "#ifndef SOFTSTART_MODEL_H\n#define SOFTSTART_MODEL_H\n\n",
            f'#include "{of}.h"\n\n',
            f'#define MODEL_SOURCE "{of}.c"\n',
            f'#define MODEL_TOKEN "{token}"\n',
            f"#define MODEL_PERIOD {_number(model.period)} /* s, of a step; 0: any length */\n",
            *(f"#define MODEL_{word.upper()} {of}_{word}\n" for word in ("State", "Input", "Output")),
            f"#define MODEL_INIT {of}_init\n",
            f"#define MODEL_FIRST(memory) {first} /* outputs before the first step */\n",
            f"#define MODEL_STEP(memory, length) {step}\n",
            f"#define MODEL_ENDED(memory) "
            f"{f'((memory)->output.{model.ended} != 0)' if model.ended else '((void)(memory), false)'}\n\n",
            "#define MODEL_VARIABLES \\\n",
            " \\\n".join(rows),
            "\n\n#endif\n",
        )
    )


def _number(value: float) -> str:
    """A number in C and XML that is read as the same one."""
    return repr(float(value))


def _start(signal: Signal) -> str:
    """The start value of an input in XML."""
    if signal.kind == "truth":
        return "true" if signal.start else "false"
    return str(int(signal.start)) if signal.kind == "whole" else _number(signal.start)


def _variability(model: Model, signal: Signal) -> str:
    """Numbers may change at any time; the outputs of a controller only at its samples."""
    sampled = model.period > 0.0 and signal in model.outputs
    return "discrete" if sampled or signal.kind in ("whole", "truth") else "continuous"


def _root(model: Model, version: Version, attributes: dict[str, str]) -> ElementTree.Element:
    root = ElementTree.Element(
        "fmiModelDescription", {"fmiVersion": version, "modelName": model.name} | attributes
    )
    root.set("generationTool", f"softstart {__version__}")
    root.set("variableNamingConvention", "structured")
    if version == "2.0":
        root.set("numberOfEventIndicators", "0")
    return root


def _common(root: ElementTree.Element, model: Model) -> None:
    """Units, categories of the log and the experiment that is suggested."""
    units = ElementTree.SubElement(root, "UnitDefinitions")
    used = {signal.unit for signal in model.signals if signal.unit} | {"s"}
    for name, exponents in (UNITS[unit] for unit in UNITS if unit in used):
        unit = ElementTree.SubElement(units, "Unit", name=name)
        ElementTree.SubElement(unit, "BaseUnit", exponents)
    categories = ElementTree.SubElement(root, "LogCategories")
    for name, what in (
        ("logStatusError", "calls that are refused"),
        ("logStatusDiscard", "steps that are refused"),
    ):
        ElementTree.SubElement(categories, "Category", name=name, description=what)
    step = _number(model.period or model.step)
    ElementTree.SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime=_number(model.stop_time), stepSize=step
    )


def description_2(model: Model, token: str, units: tuple[str, ...]) -> str:
    """`modelDescription.xml` of FMI 2.0."""
    root = _root(model, "2.0", {"guid": token})
    interface = ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.prefix,
        canHandleVariableCommunicationStepSize="false" if model.period else "true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    sources = ElementTree.SubElement(interface, "SourceFiles")
    for name in units:
        ElementTree.SubElement(sources, "File", name=name)
    _common(root, model)
    variables = ElementTree.SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ElementTree.SubElement(ElementTree.SubElement(variables, "ScalarVariable", time), "Real", unit="s")
    for number, signal in enumerate(model.signals, 1):
        scalar = ElementTree.SubElement(variables, "ScalarVariable", _attributes(model, signal, number))
        ElementTree.SubElement(scalar, TYPES["2.0"][signal.kind], _values(model, signal))
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        unknowns = ElementTree.SubElement(structure, group)
        for number in _output_numbers(model):  # the index counts the time too, from 1 on
            ElementTree.SubElement(unknowns, "Unknown", index=str(number + 1), dependencies="")
    return _text(root)


def description_3(model: Model, token: str) -> str:
    """`modelDescription.xml` of FMI 3.0."""
    root = _root(model, "3.0", {"instantiationToken": token})
    interface = ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.prefix,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="false" if model.period else "true",
    )
    if model.period:
        interface.set("fixedInternalStepSize", _number(model.period))
    _common(root, model)
    variables = ElementTree.SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ElementTree.SubElement(variables, "Float64", time, unit="s")
    for number, signal in enumerate(model.signals, 1):
        attributes = _attributes(model, signal, number) | _values(model, signal)
        ElementTree.SubElement(variables, TYPES["3.0"][signal.kind], attributes)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Output", "InitialUnknown"):
        for number in _output_numbers(model):
            ElementTree.SubElement(structure, group, valueReference=str(number), dependencies="")
    return _text(root)


def build_description(model: Model, units: tuple[str, ...]) -> str:
    """`buildDescription.xml` of FMI 3.0."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=model.prefix)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    for name in units:
        ElementTree.SubElement(files, "SourceFile", name=name)
    return _text(root)


def _output_numbers(model: Model) -> range:
    """Value references of the outputs. None of them changes before a step, whatever the inputs are."""
    return range(len(model.inputs) + 1, len(model.signals) + 1)


def _attributes(model: Model, signal: Signal, number: int) -> dict[str, str]:
    """What both versions say of a variable."""
    side = {"causality": "input"}
    if number > len(model.inputs):
        side = {"causality": "output", "initial": "calculated"}
    described = {"description": signal.description} if signal.description else {}
    return {
        "name": signal.name,
        "valueReference": str(number),
        **described,
        **side,
        "variability": _variability(model, signal),
    }


def _values(model: Model, signal: Signal) -> dict[str, str]:
    """Unit, and the start value of an input."""
    unit = {"unit": UNITS[signal.unit][0]} if signal.unit else {}
    return unit | ({"start": _start(signal)} if signal in model.inputs else {})


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def packed(contents: Mapping[str, bytes]) -> bytes:
    """The files as a zip archive; the same files give the same bytes."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as opened:
        for name in sorted(contents, key=lambda name: (name != "modelDescription.xml", name)):
            entry = zipfile.ZipInfo(name)  # with the first day that a zip archive knows
            entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
            entry.external_attr = (0o755 if name.endswith(".so") else 0o644) << 16
            opened.writestr(entry, contents[name])
    return archive.getvalue()


def find_compiler() -> tuple[list[str], str]:
    """The command of the C compiler, or none and why the FMU has no binary."""
    if platform.system() != "Linux" or platform.machine() not in ("x86_64", "AMD64"):
        return (
            [],
            "The FMU has sources only: binaries are made on 64-bit Linux; let the simulator compile it.",
        )
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        if shutil.which(named[0]) is None:
            return [], f"The FMU has sources only: CC names {named[0]}, which is not there."
        return named, ""
    for name in COMPILERS:
        if shutil.which(name):
            return [name], ""
    return [], (
        "The FMU has sources only: no C compiler was found (gcc, cc or clang, or the one named in CC); "
        "install one and export again, or let the simulator compile it."
    )


def compiled(compiler: list[str], sources: Mapping[str, str], units: tuple[str, ...]) -> tuple[bytes, str]:
    """The shared library, or why there is none; `units` are compiled and include the others."""
    with tempfile.TemporaryDirectory(prefix="softstart-fmu-") as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        command = [*compiler, *FLAGS, *units, "-o", "model.so", "-lm"]
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if ended.returncode:
            said = ended.stderr.strip().splitlines() or ["nothing"]
            first = next((line for line in said if "error" in line), said[0])
            return b"", f"The FMU has sources only: {shlex.join(compiler)} could not compile them: {first}"
        return (folder / "model.so").read_bytes(), ""
