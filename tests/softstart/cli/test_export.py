"""`softstart export`: what it prints, its JSON, and one sentence for each refusal."""

from __future__ import annotations

import pytest

from softstart import Drive
from softstart.controller.tuned import RobustFile, robust_text
from softstart.export.controller import export_controller


def test_it_writes_the_folder_and_says_k_dyn(done, place):
    out = place / "out"
    answer = done("export", "--controller", "ramp", "--as", "c", "--out", str(out))
    assert "2.10414" in answer
    assert f"make -C {out} test" in answer
    assert (out / "ramp.h").is_file()
    readme = (out / "README.md").read_text()
    assert "softstart export --controller ramp --as c" in readme
    assert str(place) not in readme


def test_json_has_files_and_figures(as_json):
    data = as_json("export", "--controller", "ramp", "--as", "c", "--prefix", "lift", "--out", "out")
    assert set(data["files"]) >= {"lift.c", "lift.h", "README.md", "vectors.csv"}
    assert data["k_dyn_in_cycles"] == pytest.approx(2.1041, abs=1e-4)
    expected = export_controller("ramp", "crane-4amtkf", prefix="lift").summary()["files"]["lift.c"]
    assert data["files"]["lift.c"] == expected


def test_tuned_gains(as_json, run, place):
    saved = RobustFile("ramp", {"time": 0.2}, Drive.load("crane-4amtkf"))
    (place / "tuned.toml").write_text(robust_text(saved))
    words = ["--gains", "tuned.toml", "--as", "c", "--out", "out"]
    data = as_json("export", "--controller", "ramp", *words)
    assert data["prefix"] == "ramp"
    expected = export_controller("ramp", "crane-4amtkf", parameters={"time": 0.2})
    assert data["k_dyn_in_cycles"] == expected.figures["k_dyn_in_cycles"]
    other = run("export", "--controller", "take-up", *words)
    assert other.code == 2
    assert "gains of ramp" in other.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--as", "st"], "needs a strategy"),
        (["--as", "fmu", "--param", "time=1"], "--param"),
        (["--controller", "ramp", "--as", "c", "--prefix", "while"], "--prefix"),
        (["--controller", "ramp", "--as", "c", "--prefix", "a__b"], "--prefix"),
        (["--controller", "ramp", "--as", "c", "--period", "0 s"], "--period"),
        (["--controller", "nope", "--as", "c"], "--controller"),
        (["--controller", "own.py:Good", "--as", "c"], "plain Python"),
        (["--controller", "ramp", "--as", "c", "--gains", "gains.csv"], "--gains"),
        (["--as", "c", "--gains", "nothing.toml"], "there is no such file"),
    ],
)
def test_refusals(words, sentence, refused):
    refused("export", "good.toml", *words, "--out", "out", says=[sentence])


def test_a_machine_as_fmu(as_json, place):
    data = as_json("export", "--as", "fmu", "--prefix", "crane", "--out", "out")
    assert {"crane_fmi2.fmu", "crane_fmi3.fmu", "README.md"} <= set(data["files"])
    assert "softstart export --as fmu --prefix crane" in (place / "out" / "README.md").read_text()


def test_a_strategy_as_fmu(as_json):
    data = as_json("export", "--controller", "ramp", "--as", "fmu", "--out", "out")
    assert {"ramp_fmi2.fmu", "ramp_fmi3.fmu", "README.md", "vectors.csv"} == set(data["files"])


def test_an_unknown_language_is_refused(run):
    code, _, err = run("export", "--controller", "ramp", "--as", "pascal", "--out", "out")
    assert code == 2
    assert "pascal" in err


def test_a_folder_with_other_files_is_kept(refused, place):
    (place / "folder" / "mine.c").write_text("mine")
    refused("export", "--controller", "ramp", "--as", "c", "--out", "folder", says=["--out"])
    assert (place / "folder" / "mine.c").read_text() == "mine"
