"""Torque profiles: values, cutting, sampling, and files that are read back with the same bits."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

from softstart import InputError, TorqueProfile


@some.composite
def profiles(draw: some.DrawFn) -> TorqueProfile:
    lengths = draw(some.lists(some.just(0.0) | some.floats(1e-6, 0.3), max_size=8))
    size = len(lengths) + 1
    torques = draw(some.lists(some.floats(-100.0, 100.0), min_size=size, max_size=size))
    return TorqueProfile(np.cumsum([0.0, *lengths]), torques)


@given(profiles(), some.floats(-120.0, 120.0), some.floats(0.0, 150.0))
def test_clipped_is_the_clipped_value_at_every_instant(
    profile: TorqueProfile, lowest: float, width: float
) -> None:
    cut = profile.clipped(lowest, lowest + width)
    between = 0.5 * (profile.time[1:] + profile.time[:-1])  # no knots: there the value steps
    even = np.linspace(0.0, 1.1 * profile.end + 0.01, 97)
    t = np.setdiff1d(np.concatenate([even, between]), profile.time)
    steepest = np.max(
        np.abs(np.diff(profile.torque)) / np.maximum(np.diff(profile.time), 1e-300), initial=0.0
    )
    off = 1e-10 + 1e-15 * min(float(steepest), 1e9)
    np.testing.assert_allclose(cut.at(t), profile.at(t).clip(lowest, lowest + width), rtol=0.0, atol=off)
    assert cut.torque.min() >= lowest
    assert cut.torque.max() <= lowest + width


@given(profiles(), some.floats(0.01, 0.5))
def test_a_sample_holds_the_mean(profile: TorqueProfile, period: float) -> None:
    sampled = profile.sampled(period)
    for k in range(int(np.ceil(profile.end / period))):
        edges = np.unique(
            np.clip([k * period, (k + 1) * period, *profile.time], k * period, (k + 1) * period)
        )
        mean = np.sum(np.diff(edges) * profile.at(0.5 * (edges[1:] + edges[:-1]))) / (edges[-1] - edges[0])
        assert float(sampled.at((k + 0.5) * period)) == pytest.approx(float(mean), abs=1e-9)
    assert float(sampled.at(profile.end + 2.0 * period)) == pytest.approx(float(profile.torque[-1]), abs=1e-9)


def test_both_profiles_are_cut_and_sampled() -> None:
    pair = TorqueProfile([0.0], [10.0], after_contact=TorqueProfile([0.0, 1.0], [0.0, 100.0]))
    assert pair.clipped(0.0, 50.0).after_contact.at([0.25, 0.75]).tolist() == [25.0, 50.0]  # type: ignore[union-attr]
    assert pair.sampled(0.5).after_contact.at([0.0, 0.5, 1.0]).tolist() == [25.0, 75.0, 100.0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("time", "torque", "words"),
    [
        ([0.0, 1.0], [1.0], "2 times for 1 torques"),
        ([0.0, 0.2, 0.1], [1.0, 1.0, 1.0], "falls from 0.2 s to 0.1 s at knot 3"),
        ([0.0], [np.nan], "not finite"),
    ],
)
def test_what_is_no_profile(time: list[float], torque: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        TorqueProfile(time, torque)


# ---- files ---------------------------------------------------------------------------------------------

quick = settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
finite = some.floats(allow_nan=False, allow_infinity=False)


@some.composite
def any_profile(draw: some.DrawFn, sensed: bool = True) -> TorqueProfile:
    times = sorted(draw(some.lists(some.floats(0.0, allow_nan=False, allow_infinity=False), max_size=8)))
    torques = draw(some.lists(finite, min_size=len(times) + 1, max_size=len(times) + 1))
    after = draw(any_profile(sensed=False)) if sensed and draw(some.booleans()) else None
    return TorqueProfile([0.0, *times], torques, after)


def bits(profile: TorqueProfile | None) -> Any:
    return profile and (profile.time.tobytes(), profile.torque.tobytes(), bits(profile.after_contact))


@quick
@given(any_profile(sensed=False))
def test_csv_gives_back_the_bits(tmp_path: Path, profile: TorqueProfile) -> None:
    profile.to_csv(tmp_path / "p.csv")
    assert bits(TorqueProfile.load(tmp_path / "p.csv")) == bits(profile)


@quick
@given(any_profile(), some.dictionaries(some.text(), some.text() | some.floats(), max_size=4))
def test_toml_gives_back_the_bits(tmp_path: Path, profile: TorqueProfile, about: dict[str, object]) -> None:
    path = tmp_path / "p.toml"
    profile.to_toml(path, about)
    assert bits(TorqueProfile.load(path)) == bits(profile)
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    assert document["controller"] == {"name": "profile"}
    assert document.get("about", {}) == {str(key): str(value) for key, value in about.items()}


GOOD = "[profile]\ntime = [0, 0.1]\ntorque = [1, 2.5]\n"


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        '[profile]\ntime = [0, 100]\ntime_unit = "ms"\ntorque = [0.001, 0.0025]\ntorque_unit = "kN*m"\n',
        "t [s],phi1 [rad],u [N*m],T [N*m]\n0,0,1,7\n0.1,3,2.5,8\n",
        "t [ms];u [kN*m]\n0;0,001\n100;0,0025\n",
    ],
)
def test_files_are_read_with_other_headers_units_and_separators(tmp_path: Path, text: str) -> None:
    path = tmp_path / ("p.toml" if "[profile]" in text else "p.csv")
    path.write_text(text, encoding="utf-8")
    read = TorqueProfile.load(path)
    assert read.time.tolist() == pytest.approx([0.0, 0.1], rel=1e-15)
    assert read.torque.tolist() == pytest.approx([1.0, 2.5], rel=1e-15)


CSV = [
    ("", "there are no numbers in it"),
    ("time,torque\n0,1\n0.1,a\n", 'line 3, torque = "a": this is not a number'),
    ("time,torque\n0.5,1\n", "its first time is 0.5 s"),
    ("0,1\n0.2\n", 'line 2, "0.2", has 1 value instead of 2'),
    ("time,torque\n0,1\n0,5,62\n", "write decimal points"),
    ("time;torque\n0;1\n0.1;62,5\n", '"62,5" has a comma and "0.1" a point'),
    ("0;1,500\n1;2,000\n", "may divide thousands"),
]
TOML = [
    ("", "no table [profile]"),
    ('[controller]\nname = "ramp"\n' + GOOD, 'for the controller "ramp"'),
    ('[profile]\ntime = "0 s"\ntorque = [1]\n', 'time = "0 s": write a list'),
    (GOOD + 'unit = "s"\n', 'no key "unit"'),
    (GOOD + 'time_unit = "N*m"\n', "time_unit"),
    (GOOD + "[after_contact]\ntime = [0]\n", "[after_contact] torque"),
]


@pytest.mark.parametrize(
    ("name", "text", "words"), [("bad.csv", *row) for row in CSV] + [("bad.toml", *row) for row in TOML]
)
def test_a_bad_file_in_one_sentence_with_its_place(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        TorqueProfile.load(tmp_path / name)
    (sentence,) = caught.value.sentences
    assert words in sentence
    assert name in sentence


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    pulse = TorqueProfile([0.0], [1.0], after_contact=TorqueProfile([0.0], [2.0]))
    (tmp_path / "latin.csv").write_bytes(b"\xe9\n0,1\n")
    for name, words in (("latin.csv", "UTF-8"), ("p.bin", "ends in .csv or .toml")):
        with pytest.raises(InputError, match=words):
            TorqueProfile.load(tmp_path / name)
    with pytest.raises(InputError, match="write this profile as TOML"):
        pulse.to_csv(tmp_path / "p.csv")
    with pytest.raises(InputError, match="cannot be written"):
        pulse.to_toml(tmp_path / "nowhere" / "p.toml")
    for name in ("a b", "a__b", "a_", "1a", ""):
        with pytest.raises(InputError, match="a C function is named"):
            pulse.to_c(tmp_path / "p.c", name)


compiler = shutil.which("cc")


@pytest.mark.skipif(compiler is None, reason="no C compiler `cc` on this machine")
def test_the_c_code_is_the_profile(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    steps = np.sort(rng.uniform(0.0, 1.0, 40)).repeat(2)
    many = TorqueProfile([0.0, *steps, 1.5], rng.uniform(-50.0, 90.0, 82))
    steep = TorqueProfile([0.0, 1e-13, 0.3, np.nextafter(0.3, 1.0), 0.5], [0.0, 62.0, 1 / 3, -7.0, 62.0])
    for i, profile in enumerate((many, steep, TorqueProfile([0.0], [5.0], after_contact=many))):
        source, library = tmp_path / f"p{i}.c", tmp_path / f"p{i}.so"
        profile.to_c(source)
        flags = ("-O2", "-Wall", "-Werror", "-shared", "-fPIC")
        command = [str(compiler), *flags, "-o", str(library), str(source), "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        code = ctypes.CDLL(str(library))
        functions = {"torque_profile": profile}
        if profile.after_contact is not None:
            functions["torque_profile_after_contact"] = profile.after_contact
        for name, played in functions.items():
            torque = getattr(code, name)
            torque.restype, torque.argtypes = ctypes.c_double, [ctypes.c_double]
            knots = played.time
            t = np.concatenate(
                [knots, np.nextafter(knots, 2.0), np.nextafter(knots[1:], 0.0), rng.uniform(0.0, 2.0, 500)]
            )
            values = np.array([torque(float(one)) for one in t])
            np.testing.assert_allclose(values, played.at(t), rtol=1e-12, atol=1e-12)
            assert torque(1e6) == played.torque[-1]
