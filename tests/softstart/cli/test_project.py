"""`softstart project`: new, open and report, and their refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from softstart import Drive, optimize
from softstart.project import Project, StoredOptimum

SLOW = 'kind = "settings"\ncontroller = "ramp"\n[parameters]\ntime = "200 ms"\n'


def test_a_project_is_made_shown_and_reported(run, place):
    Path("slow.toml").write_text(SLOW)
    Path("long.csv").write_text("time,torque\n0,20\n5,62\n")
    made = run("project", "new", "job.toml", "crane-4amtkf", "slow.toml", "long.csv")
    assert made.code == 0
    assert "slow      ramp (slow)" in made.out
    text = Path("job.toml").read_text()
    again = run("project", "new", "job.toml", "hoist-15kw")
    assert (again.code, Path("job.toml").read_text()) == (2, text)
    assert "there is such a file already" in again.err
    chosen = text.replace("[choice]\n", '[choice]\nstrategy = "slow"\n')
    Path("job.toml").write_text(chosen)
    assert "Chosen: slow on crane-4amtkf." in run("project", "show", "job.toml").out
    report = run("project", "report", "job.toml", "--out", "report.html", "--budget", "0")
    assert report.code == 0
    assert "ramp (slow)" in Path("report.html").read_text()
    Path("job.toml").write_text(chosen.replace('strategy = "slow"', 'strategy = "long"'))
    refused = run("project", "report", "job.toml", "--out", "other.html", "--budget", "0")
    assert (refused.code, Path("other.html").exists()) == (2, False)
    assert 'strategy "long": its torque changes until 5 s' in refused.err
    Path("job.toml").write_text(text.replace("version = 1", "version = 2"))
    assert run("project", "show", "job.toml").code == 2


@pytest.mark.parametrize(
    "command",
    [
        "compare FILE", "compare crane-4amtkf FILE", "simulate FILE --controller ramp",
        "sheet FILE --controller ramp", "report FILE --json", "optimize FILE", "tune FILE --controller ramp",
        "linear FILE --controller ramp", "compare crane-4amtkf --fitted-to FILE", "init FILE",
        "reduce FILE --out z", "clutch FILE", "balance FILE",
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    ("kind", "text", "remedy"),
    [
        ("project", "version = 1\n[choice]\n", '"softstart project open FILE" opens it'),
        ("strategy", SLOW, "--controllers FILE"),
        ("duty", '[[duty]]\ndo = "start"\n', "--duty FILE"),
    ],
)
def test_a_file_of_another_kind_is_told_in_one_sentence(command, kind, text, remedy, run, place):
    Path("job.toml").write_text(text)
    ended = run(*command.replace("FILE", "job.toml").split())
    assert ended.code == 2
    assert ended.err.startswith(f"softstart: job.toml: this is a {kind}, not a")
    assert remedy in ended.err
    assert ended.err.count("\n") == 1


def test_a_machine_is_no_project(run, place):
    Path("mine.toml").write_text(Drive.load("crane-4amtkf").to_toml())
    for action in ("show", "open", "report"):
        ended = run("project", action, "mine.toml")
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert "this is a machine, not a project; " in ended.err
    for words, owner in (("open mine.toml --check", "show"), ("show mine.toml --pdf r.pdf", "report")):
        assert f'it goes with "softstart project {owner}"' in run("project", *words.split()).err


def test_open_opens_the_page(run, place, monkeypatch):
    Project.new("crane-4amtkf").save("job.toml")
    served = []
    monkeypatch.setattr("softstart.cli.project.serve_page", lambda *page: served.append(page))
    assert run("project", "open", "job.toml").code == 0
    ((project, address),) = served
    assert (project, address.is_loopback) == (Project.open("job.toml"), True)


def test_optima_are_checked(run, place):
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, name="crane")
    stored = StoredOptimum.of(optimize(drive, 0.2883042), "best", "crane")
    Project.new(drive).with_part(stored).save("job.toml")
    said = run("project", "show", "job.toml", "--check").out
    assert "K_dyn 0.9092: holds" in " ".join(said.split())  # as wide as the terminal is
    Project.new(drive).with_part(stored.replace(claimed=0.8)).save("job.toml")
    ended = run("project", "show", "job.toml", "--check")
    assert ended.code == 3
    assert "0.8 was claimed" in ended.err
