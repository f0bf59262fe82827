"""Logs as inverters write them: files, currents, torques in %, clocks, uneven samples."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.softstart.test_identification import GUESS, NAMES, REVERSE, TRUTH

from softstart import InputError, Log, identify
from softstart.identification.model import LogModel
from softstart.identification.planning import made_up_log


@pytest.fixture(scope="module")
def log() -> Log:
    return made_up_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3)


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
        made = made_up_log(TRUTH, REVERSE, log_period=period, ripple=1.0, position=position, seed=seed)
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
    with pytest.raises(InputError, match=r"there are the columns .*; write --columns"):
        Log.load(path)
    read = Log.load(path, columns=columns)
    assert read.time == pytest.approx(2.0 * log.time, abs=1e-9)
    assert read.torque == pytest.approx(log.torque, abs=1e-7)
    assert read.values == pytest.approx(log.values, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("\0\0", "this is not a text file; export the signals as CSV"),
        ("s;torque;angle\n0;1;2\n1;1;2", "none is called time; write --columns .time=NAME .ms."),
        ("time;torque [%];angle\n0;1;2\n1;1;2", r"torque \[%\].*of %, as .torque=1.2\*NAME \[N\*m\]"),
        ("time,torque,speed [%]\n0,1,2\n1,1,2", r"speed \[%\].*is no unit.*speed=NAME \[rad/s\]"),
        ("time,torque,speed,angle\n0,1,1,2\n1,1,1,2", "they name both of angle and speed"),
    ],
)
def test_what_is_no_log_is_told_what_to_write(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=sentence):
        Log.load(tmp_path / "a.csv")
