"""Logs as inverters and data loggers write them: measurement files, currents, clocks, uneven samples."""

from __future__ import annotations

import math
import shlex
from pathlib import Path

import numpy as np
import pytest
from tests.softstart.test_identification import NAMES, REVERSE, TRUTH

from softstart import InputError, Log, identify
from softstart.arrays import Vector
from softstart.identification.model import LogModel
from softstart.identification.planning import made_up_log

GUESS = TRUTH.replace(gap=0.2, stiffness=200, load_inertia=0.4, motor_inertia=0.02, load_torque=12)


@pytest.fixture(scope="module")
def log() -> Log:
    return made_up_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3)


def replayed(time: Vector, demand: Vector, position: float, seed: int, ripple: float = 1.0) -> Log:
    """What the true drive logs at any instants under a demand held between them, counted by its encoder."""
    generator = np.random.default_rng(seed)
    torque = demand + ripple * generator.standard_normal(time.size)
    blank = Log(time, torque, angle=900.0 * (time - time[0]) ** 2.1, torque_is="demand")
    model = LogModel.of(blank, TRUTH.replace(start_position="mid-gap"))
    states = model.motion({"position": position}).at(model.times)
    count = 2.0 * math.pi / 4096.0
    angle = np.floor(states["phi"][:, 0] / count + generator.uniform()) * count
    return Log(time, demand, angle=angle, torque_is="demand", name=f"seed {seed}")


def demand_at(log: Log, time: Vector) -> Vector:
    """The levels of the experiment at other instants."""
    smooth = np.round(log.torque / 5.0) * 5.0
    found: Vector = smooth[np.searchsorted(log.time, time - time[0], side="right") - 1]
    return found


def holds(found, width: float = 2.0) -> bool:  # type: ignore[no-untyped-def]
    """Whether each value is within two intervals of the truth."""
    return all(
        abs(math.log(found[name].value / float(getattr(TRUTH, name))))
        < width * 0.5 * math.log(found[name].upper / found[name].lower)
        for name in NAMES
    )


# ---- the clock ------------------------------------------------------------------------------------------


def test_the_origin_of_the_clock_does_not_matter(log: Log) -> None:
    later = Log(log.time + 86400.0, log.torque, angle=log.values, torque_is="demand")
    drive = TRUTH.replace(start_position="mid-gap")
    one, two = (LogModel.of(each, drive).signals([{"position": 0.3}])[0] for each in (log, later))
    assert two == pytest.approx(one, abs=1e-7)  # a day in float64 has instants of 1.5e-11 s


def test_uneven_samples_are_fitted_as_even_ones_are(log: Log) -> None:
    generator = np.random.default_rng(8)
    end = float(log.time[-1])
    steps = generator.uniform(1e-3, 5e-3, 2 * int(end / 3e-3))
    time = np.concatenate([[0.0], np.cumsum(steps)])
    time = time[time < end]
    uneven = replayed(time, demand_at(log, time), -0.4, seed=8)
    found = identify(uneven, GUESS, searches=3)
    assert holds(found)
    assert found["gap"].half_width < 0.03


def test_logs_with_clocks_and_sampling_of_their_own_are_fitted_together(log: Log) -> None:
    end = float(log.time[-1])
    each = []
    for seed, period, origin, position in ((4, 2e-3, 0.0, -0.7), (5, 5e-3, 1000.0, 0.5)):
        time = np.arange(int(end / period)) * period
        made = replayed(time, demand_at(log, time), position, seed)
        each.append(
            Log(time + origin, made.torque, angle=made.values, torque_is="demand", name=f"log {seed}")
        )
    both = identify(each, GUESS, searches=3)
    alone = identify(each[1], GUESS, searches=3)
    assert holds(both)
    assert both["gap"].half_width < alone["gap"].half_width
    assert both["position 1"].value == pytest.approx(-0.7, abs=0.1)
    assert both["position 2"].value == pytest.approx(0.5, abs=0.1)


# ---- current --------------------------------------------------------------------------------------------


def test_a_current_with_a_constant_stands_for_the_torque(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = zip(log.time.tolist(), (log.torque / 1.2).tolist(), log.values.tolist(), strict=True)
    path.write_text("t [s],current [A],phi [rad]\n" + "\n".join(f"{t},{i},{a}" for t, i, a in rows))
    read = Log.load(path, columns={"angle": "phi"}, torque_is="demand", torque_constant="1200 N*m/kA")
    assert read.torque == pytest.approx(log.torque, rel=1e-14, abs=1e-14)
    assert read.notes[0] == "the torque is 1.2 N m/A times the current"
    turned = Log.load(
        path, columns={"angle": "-phi", "current": "-current"}, torque_is="demand", torque_constant=1.2
    )
    assert turned.torque == pytest.approx(-log.torque, rel=1e-14, abs=1e-14)
    for columns, constant, sentence in (
        ({}, None, "it has a current and no torque; give the torque constant"),
        ({"current": "current"}, None, "give the torque constant with it"),
        ({"torque": "current"}, 1.2, "with a torque constant the current is read"),
        ({}, "1.2 N*m", "torque_constant = .*is a torque"),
        ({}, -1.2, "give a value above 0"),
    ):
        with pytest.raises(InputError, match=sentence):
            Log.load(path, columns={"angle": "phi", **columns}, torque_constant=constant)


def test_a_unit_in_columns_takes_the_place_of_that_of_the_file(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    speed = np.gradient(log.values, log.time) * 30.0 / math.pi
    rows = zip(log.time.tolist(), log.torque.tolist(), speed.tolist(), strict=True)
    path.write_text("t [s];M [%];n [1/min]\n" + "\n".join(f"{t};{u};{n}" for t, u, n in rows))
    names = {"time": "t", "torque": "M [N*m]", "speed": "n[rpm]"}
    read = Log.load(path, columns=names)
    assert read.kind == "speed"
    assert read.values == pytest.approx(speed * math.pi / 30.0, rel=1e-12, abs=1e-12)
    assert np.array_equal(Log.load(path, columns=names | {"speed": "n"}).values, read.values)
    with pytest.raises(InputError, match="columns: speed = "):
        Log.load(path, columns=names | {"speed": "n [Hz]"})
    with pytest.raises(InputError, match="did you mean torque"):
        Log.load(path, columns={"torqe": "M"})


# ---- traces of inverters, scopes and spreadsheets ----------------------------------------------------------

TRACES = {  # heading, unit of the times in ms, row, what is read from the message
    "TwinCAT": (
        "Name;MyScope\nFile;trace_0017\nStarttime of export;2025-03-11 08:12:05\nSampleTime[ms];4\n\n"
        "Name;ActTorque;;Name;ActPos\nData-Type;REAL32;;Data-Type;REAL64\nUnit;%;;Unit;deg\nOffset;0;;Offset;0\n",
        "{t:.0f};{percent:.8f};;{t:.0f};{deg:.8f}", ",", "utf-8",
    ),
    "spreadsheet": (
        "Zeit [ms];Drehmoment [Nm];Lage [deg]", "{t:.1f};{torque:.8f};{deg:.8f}", ",", "utf-8-sig",
    ),
    "Siemens": (
        "Time [ms];Channel 1 r0080 Actual torque [Nm];Channel 2 Actual position [deg]",
        "{t:.1f};{torque:.8f};{deg:.8f}", ".", "utf-8",
    ),
    "DIN": ("t / ms;M / Nm;phi / (rev)", "{t:.1f};{torque:.8f};{turns:.10f}", ",", "utf-8"),
    "tabs": (
        "Motor trace\texport 3.2\nTime\tTorque ref.\tPosition\nms\tNm\trev",
        "{t:.1f}\t{torque:.8f}\t{turns:.10f}", ".", "utf-16",
    ),
    "commas": (
        "Controller,axis 1\nt_1 [ms],fActTorque (0.1% Mn),t_2 [ms],fActPosition (\N{DEGREE SIGN})",
        "{t:.1f},{mille:.8f},{t:.1f},{deg:.8f}", ".", "cp1252",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", TRACES)
def test_a_trace_is_read_by_the_one_command_that_its_message_gives(
    log: Log, kind: str, tmp_path: Path
) -> None:
    heading, row, point, encoding = TRACES[kind]
    rows = [
        row.format(
            t=1e3 * t, torque=u, percent=100.0 * u / 12.0, mille=1e3 * u / 12.0, deg=math.degrees(a),
            turns=a / (2.0 * math.pi),
        ).replace(".", point)
        for t, u, a in zip(2.0 * log.time, log.torque, log.values, strict=True)
    ]  # fmt: skip
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([heading, *rows]), encoding=encoding)
    with pytest.raises(InputError) as refused:
        Log.load(path)
    told = shlex.split(str(refused.value).partition("; write ")[2].partition(" (the torque")[0].rstrip("."))
    assert told[::2] == ["--columns", "--rated-torque"][: len(told) // 2]
    columns = dict(one.split("=") for one in told[1].split(","))
    read = Log.load(path, columns=columns, rated_torque=told[3] if len(told) > 2 else None)
    assert read.time == pytest.approx(2.0 * log.time, abs=1e-9)
    assert read.torque == pytest.approx(log.torque, abs=1e-7)
    assert read.values == pytest.approx(log.values, abs=1e-7)


def test_columns_of_a_trace_with_instants_of_their_own_are_joined(tmp_path: Path) -> None:
    coarse, fine = np.arange(0.0, 0.4, 4e-3), np.arange(0.0007, 0.38, 3e-3)
    rows = [
        f"{t if i < coarse.size else ''};{20.0 if i < coarse.size else ''};;{s};{40.0 * s**2.1}"
        for i, (t, s) in enumerate(zip(np.resize(coarse, fine.size), fine, strict=True))
    ]
    path = tmp_path / "trace.csv"
    path.write_text("\n".join(["time [s];torque [N*m];;time [s];angle [rad]", *rows]))
    read = Log.load(path)
    assert read.time.size == np.union1d(coarse, fine)[1:].size - np.sum(coarse > fine[-1])
    assert int(np.isfinite(read.values).sum()) == fine.size
    assert np.all(read.torque == 20.0)


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.mat", "MATLAB 5.0", "this is a MATLAB file; export the signals as CSV"),
        ("a.csv", "\0\0", "this is not a text file; export the signals as CSV"),
        ("a.csv", "0;1;2\n1;1;2", "no line above the numbers names the columns"),
        ("a.csv", "s;torque;angle\n0;1;2\n1;1;2", "none has a name of times, .*--columns .time=NAME .ms."),
        (
            "a.csv",
            "time;torque [%];angle\n0;1;2\n1;1;2",
            "it is in %; give the torque at 100 %, as --rated-t",
        ),
        ("a.csv", "time,torque [% TN],angle\n0,1,2\n1,1,2", r"torque=torque \[%\]. --rated-torque .12 N"),
        ("a.csv", "time,torque,speed [%]\n0,1,2\n1,1,2", "speed in % is not read; write it in rad/s: %/100"),
        ("a.csv", "time,torque,torque,angle\n0,1,1,2\n1,1,1,2", "more than one is called torque; rename one"),
        ("a.csv", "time torque angle\n0 1 2\n1 1 2", "one column; divide columns by semicolons, comma"),
    ],
)
def test_what_is_no_trace_is_told_what_to_write(tmp_path: Path, name: str, text: str, sentence: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=sentence):
        Log.load(tmp_path / name)


# ---- measurement files ----------------------------------------------------------------------------------


def measurement(path: Path, *channels: tuple[str, str, Vector, Vector]) -> Path:
    """An MDF4 file, written by asammdf: name, unit, instants and values of each channel."""
    import asammdf

    with asammdf.MDF(version="4.10") as made:
        for name, unit, time, values in channels:
            made.append([asammdf.Signal(values, time, unit=unit, name=name, encoding="utf-8")])
        made.save(path, overwrite=True)
    return path


def test_a_measurement_file_is_the_log_that_was_written(log: Log, tmp_path: Path) -> None:
    path = measurement(
        tmp_path / "start.mf4",
        ("M_soll", "kNm", log.time, 1e-3 * log.torque),
        ("phi_ist", "deg", log.time, np.degrees(log.values)),
        ("n_ist", "1/s", log.time, np.zeros(log.time.size)),
    )
    read = Log.load(path, columns={"torque": "M_soll", "angle": "phi_ist"}, torque_is="demand")
    assert np.array_equal(read.time, log.time)
    assert read.torque == pytest.approx(log.torque, rel=1e-12, abs=1e-12)
    assert read.values == pytest.approx(log.values, rel=1e-12, abs=1e-12)
    assert read.name == "start.mf4"
    assert not [note for note in read.notes if "instants" in note]
    for columns, sentence in (
        ({}, "there are the columns M_soll .* they name neither of angle and speed"),
        ({"angle": "phi_ist"}, "none is called torque; write --columns torque=M_soll,angle=phi_ist"),
        ({"torque": "M_soll", "speed": "n_ist"}, "n_ist.*frequency"),
        ({"torque": "M_soll", "angle": "phi_ist", "time": "t"}, "leave time out"),
    ):
        with pytest.raises(InputError, match=sentence):
            Log.load(path, columns=columns)


def speed_of(log: Log) -> Vector:
    """The motor's speed under the torque of a log."""
    model = LogModel.of(log, TRUTH.replace(start_position="mid-gap"))
    found: Vector = model.motion({}).at(model.times)["w"][:, 0]
    return found


@pytest.mark.parametrize("torque_is", ["demand", "measured"])
def test_channels_with_instants_of_their_own_tell_what_common_ones_tell(
    torque_is: str, tmp_path: Path
) -> None:
    coarse, fine = np.arange(0.0, 0.4, 4e-3), np.arange(0.0007, 0.38, 3e-3)
    torque = 20.0 + 15.0 * np.sin(9.0 * coarse)
    path = measurement(
        tmp_path / "a.mf4", ("torque", "Nm", coarse, torque), ("angle", "rad", fine, 40.0 * fine**2.1)
    )
    read = Log.load(path, torque_is=torque_is)  # type: ignore[arg-type]
    assert any("different instants" in note for note in read.notes)
    # the plant under the merged log moves as under the torque alone, sampled at the instants of the angle
    merged = speed_of(read)
    first = float(read.time[0])
    assert first == pytest.approx(0.0007)
    # from the same start: the torque before the first common instant is cut off in both
    late = coarse[coarse > first]
    begin = np.interp(first, coarse, torque) if torque_is == "measured" else torque[0]
    cut = Log(np.r_[first, late], np.r_[begin, torque[coarse > first]], angle=np.r_[0.0, late] ** 2.1,
              torque_is=torque_is)  # type: ignore[arg-type]  # fmt: skip
    alone = speed_of(cut)
    common = np.isin(read.time, cut.time)
    assert common.sum() == (cut.time <= read.time[-1]).sum()
    assert merged[common] == pytest.approx(alone[: common.sum()], rel=1e-11, abs=1e-12)
    assert int(np.isfinite(read.values).sum()) == fine.size


def test_instants_that_differ_by_rounding_are_one(tmp_path: Path) -> None:
    time = np.arange(0.0, 0.4, 2e-3)
    torque = np.where(time < 0.2, 20.0, 30.0)
    path = measurement(
        tmp_path / "a.mf4", ("torque", "Nm", time + 1e-9, torque), ("angle", "rad", time, 40.0 * time**2.1)
    )
    read = Log.load(path, torque_is="demand")
    assert read.time.size == time.size
    assert np.array_equal(read.torque, torque)


def test_what_is_no_measurement_file_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "a.mf4"
    broken.write_bytes(b"no measurement")
    with pytest.raises(InputError, match="cannot be read as an MDF file"):
        Log.load(broken)
    with pytest.raises(InputError, match="there is no such file"):
        Log.load(tmp_path / "nowhere.mf4")
    time = np.arange(0.0, 0.4, 2e-3)
    words = measurement(
        tmp_path / "b.mf4",
        ("torque", "", time, np.array([b"on"] * time.size)),
        ("angle", "rad", time, 40.0 * time**2.1),
    )
    with pytest.raises(InputError, match="holds text"):
        Log.load(words)
    apart = measurement(
        tmp_path / "c.mf4", ("torque", "Nm", time + 1.0, 1.0 + time), ("angle", "rad", time, 40.0 * time**2.1)
    )
    with pytest.raises(InputError, match="not logged at the same time"):
        Log.load(apart)


def test_without_the_package_a_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "asammdf", None)
    path = tmp_path / "a.mf4"
    path.write_bytes(b"MDF     4.10")
    with pytest.raises(InputError, match=r"softstart\[mdf\]"):
        Log.load(path)
