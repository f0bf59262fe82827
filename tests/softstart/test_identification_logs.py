"""Logs as inverters write them: files, currents, torques in %, clocks, uneven samples."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.test_identification import GUESS, NAMES, REVERSE, TRUTH

from softstart import InputError, Log, identify, simulate
from softstart.identification.model import LogModel
from softstart.identification.planning import simulated_log
from softstart.identification.solving import _check_step


@pytest.fixture(scope="module")
def log() -> Log:
    return simulated_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3)


# ---- the clock ------------------------------------------------------------------------------------------


def test_the_origin_of_the_clock_does_not_matter(log: Log) -> None:
    later = Log(log.time + 86400.0, log.torque, angle=log.values, torque_is="demand")
    drive = TRUTH.replace(start_position="mid-gap")
    one, two = (LogModel.of(each, drive).signals([{"position": 0.3}])[0] for each in (log, later))
    assert two == pytest.approx(one, abs=1e-7)  # a day in float64 has instants of 1.5e-11 s


@pytest.mark.slow
def test_logs_with_clocks_and_sampling_of_their_own_are_fitted_together() -> None:
    each = []
    for seed, period, origin, position in ((4, 2e-3, 0.0, -0.7), (5, 5e-3, 1000.0, 0.5)):
        made = simulated_log(TRUTH, REVERSE, log_period=period, ripple=1.0, position=position, seed=seed)
        each.append(Log(made.time + origin, made.torque, angle=made.values, torque_is="demand"))
    both = identify(each, GUESS, searches=3)
    alone = identify(each[1], GUESS, searches=3)
    for name in NAMES:
        off = abs(math.log(both[name].value / float(getattr(TRUTH, name))))
        assert off < math.log(both[name].upper / both[name].lower), name  # twice the interval
    assert both["gap"].half_width < alone["gap"].half_width
    assert both["position 1"].value == pytest.approx(-0.7, abs=0.1)
    assert both["position 2"].value == pytest.approx(0.5, abs=0.1)


# ---- columns --------------------------------------------------------------------------------------------


def test_columns_have_factors_signs_and_units_of_their_own(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    speed = np.gradient(log.values, log.time) * 30.0 / math.pi
    rows = zip(log.time.tolist(), (log.torque / 1.2).tolist(), speed.tolist(), strict=True)
    path.write_text("t [s];I [A];n [1/min]\n" + "\n".join(f"{t};{i};{n}" for t, i, n in rows))
    names = {"time": "t", "torque": "1.2 * I [N*m]", "speed": "n[rpm]"}
    read = Log.load(path, columns=names)
    assert read.torque == pytest.approx(log.torque, rel=1e-14, abs=1e-14)
    assert read.values == pytest.approx(speed * math.pi / 30.0, rel=1e-12, abs=1e-12)
    turned = Log.load(path, columns=names | {"torque": "-1.2*I[N*m]", "speed": "-n"})
    assert np.array_equal(turned.torque, -read.torque)
    assert np.array_equal(turned.values, -read.values)
    for changed, sentence in (
        ({"torque": "1.2*I"}, r"I \[A\].*is a current.*\[N\*m\]"),
        ({"speed": "n [Hz]"}, r"n .1/min.*frequency"),
        ({"torqe": "I"}, "did you mean torque"),
    ):
        with pytest.raises(InputError, match=sentence):
            Log.load(path, columns=names | changed)


# ---- what the encoder tells -----------------------------------------------------------------------------


@pytest.mark.parametrize("unit", ["turn", "deg", "rpm"])
def test_steps_of_the_encoder_in_another_unit_are_noticed(unit: str) -> None:
    """Turns or degrees that are called rad, rpm that are called rad/s."""
    kind, size = next((kind, sizes[unit]) for kind, sizes in SIZES.items() if unit in sizes)
    log = simulated_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3, signal=kind)  # type: ignore[arg-type]
    wrong = Log(log.time, log.torque, **{kind: 1.0005 * log.values / size}, torque_is="demand")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=rf"counts of 1024 encoder lines in {unit}; .*{kind}=NAME\[{unit}\]"):
        _check_step(wrong, 1024.0)
    for lines in (0.0, 1000.0, 4096.0):  # none, or another one
        _check_step(wrong, lines)
    _check_step(log, 1024.0)


# ---- files of inverters, scopes and spreadsheets -----------------------------------------------------------

FILES = {  # heading, row, decimal mark, encoding, what the columns are called
    "preamble": (
        "Name;MyScope\nStarttime of export;2025-03-11 08:12:05\n\nTime [ms];ActTorque [%];ActPos [deg]",
        "{t:.0f};{percent:.8f};{deg:.8f}", ",", "utf-8", {"torque": ".12*ActTorque[Nm]", "angle": "ActPos"},
    ),
    "tabs": (
        "Motor trace\texport 3.2\nTime\tTorque ref.\tPosition", "{t:.1f}\t{torque:.8f}\t{turns:.10f}", ".",
        "utf-16", {"time": "Time [ms]", "torque": "Torque ref. [Nm]", "angle": "Position [rev]"},
    ),
}  # fmt: skip


LAYOUTS = {  # what stands above the numbers, a row, decimal mark, columns
    "date line": (
        "Drive recorder, axis X\n2024-05-01 10:00:12\nsamples: 351\n\ntime [ms],torque [N*m],angle [rad]",
        "{ms},{torque},{angle}", ".", {},
    ),
    "names, then words": (
        "time [ms];torque [N*m];angle [rad]\nof axis X; 2 channels\n", "{ms};{torque};{angle}", ",", {},
    ),
    "units below": ("time,torque,angle\ns,Nm,rad", "{s},{torque},{angle}", ".", {}),
    "units of a current and of degrees below": ("t;strom;winkel\ns;A;°", "{s};{current};{deg}", ",",
        {"time": "t", "torque": "1.2*strom[N*m]", "angle": "winkel"}),
    "units above": ("(ms);(Nm);(deg)\ntime;torque;angle", "{ms};{torque};{deg}", ",", {}),
    "units in names": ("t/ms;torque in Nm;angle_deg", "{ms};{torque};{deg}", ",", {}),
    "behind a mark": ("# time [ms] , torque [N*m] , angle [rad]", "{ms},{torque},{angle}", ".", {}),
    "scope": (
        "Name\tStart of travel drive\nFile\tC:\\start.csv\n"
        "Starttime of export\t133964386997165000\tMontag, 1. Januar 2024\t10:00:00.000\n\n"
        "Name\tActTorque\tName\tActPos\nSymbolComment\tActTorque\tSymbolComment\tActPos\n"
        "SampleTime[ms]\t4\tSampleTime[ms]\t4\nNetID\t5.1.2.3.1.1\tNetID\t5.1.2.3.1.1\n"
        "BitMask\t0xff\tBitMask\t0xff\n", "{ms}\t{torque}\t{ms}\t{deg}", ".",
        {"torque": "ActTorque[N*m]", "angle": "ActPos[deg]"},
    ),
    "scope with units": (
        "Name;MyScope\nSampleTime[ms];4\n\nName;ActTorque;;Name;ActPos\nData-Type;REAL32;;Data-Type;REAL64\n"
        "Unit;%;;Unit;deg\nOffset;0;;Offset;0\n", "{ms};{percent};;{ms};{deg}", ",",
        {"torque": "ActTorque[% of 12 N*m]", "angle": "ActPos"},
    ),
    "per mille": ("time [ms];M [‰ of 12 Nm];angle [rad]", "{ms};{permille};{angle}", ",", {"torque": "M"}),
    "per mille, asked": ("time [ms];M [‰];angle [rad]", "{ms};{permille};{angle}", ",",
        {"torque": "M[per mille of 12 Nm]"}),
    "time of day": ("time,torque [Nm],angle [rad]", "{clock},{torque},{angle}", ".", {}),
    "date and time": ("time;torque [Nm];angle [rad]", "2024-05-01 {clock};{torque};{angle}", ",", {}),
    "counts": ("time [ms];torque [Nm];angle [counts]", "{ms};{torque};{counts}", ",",
        {"angle": "1/1000000*angle[turn]"}),
    "spaces, in columns of one width": ("  time [ms]    torque [N*m]     angle [rad]",
        "{ms:>11} {torque:>15} {angle:>15}", ".", {}),
    "spaces, decimal commas": ("time[ms] torque (N m) angle[deg]", "{ms}   {torque} {deg}  ", ",", {}),
    "spaces, units below": ("PLC trace of 1 May\n  time  torque   angle\n    ms     N*m     rad",
        "   {ms}   {torque}   {angle}", ".", {}),
    "spaces, units in brackets below": ("time  torque  angle\n[ms] [N m] [deg]",
        "{ms} {torque} {deg}", ".", {}),
    "spaces in names": ("Time (ms)   Motor torque [Nm]   Rotor position [deg]", "{ms} {torque} {deg}", ".",
        {"time": "Time", "torque": "Motor torque", "angle": "Rotor position"}),
    "spaces behind a mark of MATLAB": ("% saved by hand\n%  time [ms]  torque [N*m]  angle [rad]",
        "   {ms}e+00   {torque}e+00   {angle}e+00", ".", {}),
    "spaces, date and time": ("time  torque [Nm]  angle [rad]",
        "2024-05-01 {clock}  {torque}  {angle}", ".", {}),
    "spaces and tabs": ("time [ms]\ttorque [Nm]\tangle [rad]", " {ms} \t{torque}  {angle}", ".", {}),
    "spaces behind commas": ("time [ms], torque [Nm],  angle [rad]", " {ms},  {torque}, {angle}", ".", {}),
    "no unit of time": ("time;torque [Nm];angle [rad]", "{ms};{torque};{angle}", ",", {}),
}  # fmt: skip


@pytest.mark.parametrize("kind", LAYOUTS)
def test_headings_clocks_and_shares_are_read(log: Log, kind: str, tmp_path: Path) -> None:
    """The same signals in each file, from a quarter second before midnight to two seconds after it."""
    above, row, point, columns = LAYOUTS[kind]
    rows, time = [], 4.0 * log.time
    for t, u, a in zip(time, log.torque, log.values, strict=True):
        day = 86399.75 + t
        minutes, seconds = divmod(day % 86400.0, 60.0)
        clock = f"{int(minutes // 60):02}:{int(minutes % 60):02}:{seconds:09.6f}"
        cells = {
            "s": f"{t:.6f}", "ms": f"{1e3 * t:.3f}", "torque": f"{u:.9f}", "angle": f"{a:.9f}",
            "clock": clock, "deg": f"{math.degrees(a):.9f}", "percent": f"{u / 0.12:.9f}",
            "current": f"{u / 1.2:.9f}",
            "permille": f"{u / 0.012:.9f}", "counts": f"{1e6 * a / (2.0 * math.pi):.0f}",
        }  # fmt: skip
        rows.append(row.format(**{key: cell.replace(".", point) for key, cell in cells.items()}))
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([above, *rows, "EOF"]), encoding="utf-8")
    read = Log.load(path, columns=columns)
    assert read.time - read.time[0] == pytest.approx(time, abs=1e-9)
    assert read.torque == pytest.approx(log.torque, abs=1e-7)
    assert read.values - read.values[0] == pytest.approx(log.values - log.values[0], abs=4e-6)


@pytest.mark.parametrize("kind", FILES)
def test_a_file_is_read_by_the_names_of_its_columns(log: Log, kind: str, tmp_path: Path) -> None:
    heading, row, point, encoding, columns = FILES[kind]
    rows = [
        row.format(
            t=1e3 * t, torque=u, percent=100.0 * u / 12.0, deg=math.degrees(a), turns=a / (2.0 * math.pi)
        ).replace(".", point)
        for t, u, a in zip(2.0 * log.time, log.torque, log.values, strict=True)
    ]
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([heading, *rows]), encoding=encoding)
    with pytest.raises(InputError, match=r"there are the columns .*; set columns to"):
        Log.load(path)
    read = Log.load(path, columns=columns)
    assert read.time == pytest.approx(2.0 * log.time, abs=1e-9)
    assert read.torque == pytest.approx(log.torque, abs=1e-7)
    assert read.values == pytest.approx(log.values, abs=1e-7)


# ---- units ----------------------------------------------------------------------------------------------

SIZES = {  # of each unit in SI, by hand
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "torque": {"N*m": 1.0, "kN*m": 1e3, "Ncm": 1e-2, "lbf*ft": 1.3558179483314, "% of 35 Nm": 0.35,
               "‰ of 35 N*m": 0.035},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi, "mrad": 1e-3},
    "speed": {"rad/s": 1.0, "rpm": math.pi / 30.0, "1/min": math.pi / 30.0, "deg/s": math.pi / 180.0,
              "turn/s": 2.0 * math.pi},
}  # fmt: skip
TIME = np.arange(40) * 4e-3
TORQUE, SPEED = np.linspace(20.0, 40.0, 40), 900.0 * TIME**1.1
SIGNALS = {"time": TIME, "torque": TORQUE, "angle": 900.0 / 2.1 * TIME**2.1, "speed": SPEED}


def written(path: Path, columns: dict[str, tuple[str, Any]]) -> Path:
    """A file with these signals, each under a heading and in a unit of this size."""
    rows = zip(*(SIGNALS[key] / size for key, (_, size) in columns.items()), strict=True)
    heading = ";".join(name for name, _ in columns.values())
    lines = [";".join(f"{value:.17g}" for value in row) for row in rows]
    path.write_text("\n".join([heading, *lines]), encoding="utf-8")
    return path


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(["angle", "speed"]), st.data(), st.booleans())
def test_the_unit_of_each_signal_does_not_matter(kind: str, data: st.DataObject, asked: bool) -> None:
    """Whether the heading or the command names it; the other motion stands beside, in a unit of its own."""
    other = "speed" if kind == "angle" else "angle"
    keys = ("time", "torque", kind, other)
    units = {key: data.draw(st.sampled_from(sorted(SIZES[key])), label=key) for key in keys}
    named = {key: "beside" if key == other else f"{key}_1" for key in keys}
    in_file = {key: named[key] if asked and key != other else f"{named[key]} [{units[key]}]" for key in keys}
    columns = {key: named[key] + (f"[{units[key]}]" if asked else "") for key in keys[:3]}
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder, "a.csv"), {key: (in_file[key], SIZES[key][units[key]]) for key in keys})
        read = Log.load(path, columns=columns)
    assert read.kind == kind
    assert read.time == pytest.approx(TIME, rel=1e-12)
    assert read.torque == pytest.approx(TORQUE, rel=1e-12)
    assert read.values == pytest.approx(SIGNALS[kind], rel=1e-12, abs=1e-12)
    assert read.notes == ()


def test_the_traces_of_a_start_are_a_log(tmp_path: Path) -> None:
    """Their T is the torque of the shaft beside t, a time; u and w1 are what an inverter has."""
    run = simulate("crane-4amtkf", "ramp")
    run.to_csv(tmp_path / "trace.csv")
    read = Log.load(tmp_path / "trace.csv")
    assert read.kind == "speed"
    seen, at = np.isfinite(read.values), run.at(read.time)
    assert seen.sum() > 700
    assert read.values[seen] == pytest.approx(at["w1"][seen], abs=1e-9)
    assert read.torque == pytest.approx(at["u"], abs=1e-9)


def test_columns_between_spaces_that_nothing_names_or_measures_are_questions(tmp_path: Path) -> None:
    """As `save -ascii` writes them, without a heading; the sentence's own heading mends it."""
    path = tmp_path / "a.txt"
    rows = "\n".join("".join(f"  {v: .7e}" for v in row) for row in zip(TIME, TORQUE, SPEED, strict=True))
    path.write_text(rows)
    with pytest.raises(
        InputError, match=r"no line above the numbers names the columns.*, as (.*)\.$"
    ) as refused:
        Log.load(path)
    form = str(refused.value).rpartition(", as ")[2].rstrip(".")
    path.write_text(f"{form}\n{rows}")
    read = Log.load(path)
    assert read.time == pytest.approx(1e-3 * TIME, rel=1e-6)  # the heading says ms
    assert read.values == pytest.approx(SPEED * math.pi / 30.0, rel=1e-6)
    path.write_text(f"time torque speed\n{rows}")
    with pytest.raises(InputError, match=r'"speed", the speed, has no unit'):
        Log.load(path)


@pytest.mark.parametrize("kind", ["angle", "speed"])
def test_a_motion_without_a_unit_is_a_question(kind: str, tmp_path: Path) -> None:
    path = written(
        tmp_path / "a.csv", {"time": ("t", 1.0), "torque": ("torque [Nm]", 1.0), kind: (kind, 1.0)}
    )
    unit = {"angle": "turn", "speed": "rpm"}[kind]
    with pytest.raises(InputError, match=rf'"{kind}", the {kind}, has no unit.*"{kind}={kind}\[{unit}\]"'):
        Log.load(path)
    read = Log.load(path, columns={kind: f"{kind}[{unit}]"})
    assert read.values == pytest.approx(SIZES[kind][unit] * SIGNALS[kind], rel=1e-12)
    assert read.notes == ('"t" has no unit and was taken for a time in s',)


@pytest.mark.parametrize("unit", ["rad", "deg", "turn", "rad/s", "rpm", "deg/s"])
def test_the_unit_of_a_motion_is_told_by_its_derivative_or_integral(unit: str, tmp_path: Path) -> None:
    """A column of any name, whose unit is stated."""
    kind, beside = ("angle", "n_act [rpm]") if unit in SIZES["angle"] else ("speed", "pos [deg]")
    other = {"angle": ("speed", math.pi / 30.0), "speed": ("angle", math.pi / 180.0)}[kind]
    columns = {"time": ("t [s]", 1.0), "torque": ("torque [Nm]", 1.0), kind: (kind, SIZES[kind][unit])}
    read = Log.load(written(tmp_path / "a.csv", columns | {other[0]: (beside, other[1])}))
    assert read.values == pytest.approx(SIGNALS[kind], rel=1e-12, abs=1e-12)
    assert f'"{kind}" has no unit; it is in {unit}, as the column "{beside}" tells' in read.notes


def test_two_units_without_a_name_and_units_that_contradict_are_questions(tmp_path: Path) -> None:
    path, rpm = tmp_path / "a.csv", math.pi / 30.0
    columns = {"time": ("t [s]", 1.0), "torque": ("torque [Nm]", 1.0)}
    two = columns | {"angle": ("angle", 2.0 * math.pi), "speed": ("n_act", rpm)}
    with pytest.raises(InputError, match=r'column "n_act" beside it fits angle in turn with n_act in rpm'):
        Log.load(written(path, two))
    counts = columns | {"angle": ("angle", 2.0 * math.pi / 4096.0), "speed": ("n_act [rpm]", rpm)}
    with pytest.raises(InputError, match=r'one of it is 0.00153\d* rad, by the column "n_act \[rpm\]"'):
        Log.load(written(path, counts))
    # turns called rad, and rpm called rad/s
    for wrong, right in (
        ({"angle": ("angle [rad]", 2.0 * math.pi), "speed": ("n_act [rpm]", rpm)}, r"angle=angle\[turn\]"),
        ({"speed": ("speed [rad/s]", rpm), "angle": ("pos [deg]", math.pi / 180.0)}, r"speed=speed\[rpm\]"),
    ):
        with pytest.raises(InputError, match=rf"cannot both be right.*{right}"):
            Log.load(written(path, columns | wrong))
    # a column that is nearly its derivative tells nothing
    swaying = 1.0 + 0.3 * np.sin(40.0 * TIME)
    columns_like = columns | {"angle": ("angle", 1.0), "speed": ("n_set [rpm]", rpm * swaying)}
    with pytest.raises(InputError, match=r'angle=1/4096\*angle\[turn\]"\.$'):
        Log.load(written(path, columns_like))
    # a column beside it that belongs behind a gear is none
    geared = columns | {"angle": ("angle [rad]", 1.0), "speed": ("n_load [rpm]", 38.1 * rpm)}
    assert Log.load(written(path, geared)).values == pytest.approx(SIGNALS["angle"], rel=1e-12, abs=1e-12)


def test_a_torque_without_a_unit_is_taken_for_newton_metres_and_that_is_said(tmp_path: Path) -> None:
    path = written(
        tmp_path / "a.csv", {"time": ("t [s]", 1.0), "torque": ("M", 1.0), "angle": ("angle [rad]", 1.0)}
    )
    (note,) = Log.load(path, columns={"torque": "M"}).notes
    assert "taken for a torque in N m, which no motion can check" in note
    assert '"torque=M[% of 35 N*m]"' in note


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("\0\0", "this is not a text file; export the signals as CSV"),
        ("s;torque;angle\n0;1;2\n1;1;2", "none is called time; set columns to .time=NAME .ms."),
        ("time;torque [%];angle\n0;1;2\n1;1;2", r"torque \[%\].*of %, as .torque=NAME \[% of 35 N\*m\]"),
        ("time,torque,speed [%]\n0,1,2\n1,1,2", r"speed \[%\].*is no unit.*speed=NAME \[rad/s\]"),
        ("time,torque,speed,angle\n0,1,1,2\n1,1,1,2", "they name both of angle and speed"),
        (
            "time,torque,angle [counts]\n0,1,1\n1,1,2",
            r"angle=1/4096\*NAME \[turn\]. with the counts of a turn",
        ),
        ("time,torque,angle\n10:00:00,1,1\n10:00:0x,1,2", "this is no time of day"),
        ("time;torque [‰];angle\n0;1;2\n1;1;2", r"of ‰, as .torque=NAME \[‰ of 35 N\*m\]"),
        ("torque\nnone", "no line of its first 400 has numbers in two columns"),
        ("0;1;2\n1;1;2", "no line above the numbers names the columns"),
        ("Name;torque;Name;n\n0;1;0;2\n1;1;1.5;2", "samples at other times than the first channel"),
    ],
)
def test_what_is_no_log_is_told_what_to_write(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=sentence):
        Log.load(tmp_path / "a.csv")
