"""`softstart project`: new, open and report, and their refusals."""

from __future__ import annotations

from pathlib import Path

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
    assert "Chosen: slow on crane-4amtkf." in run("project", "open", "job.toml").out
    report = run("project", "report", "job.toml", "--out", "report.html", "--budget", "0")
    assert report.code == 0
    assert "ramp (slow)" in Path("report.html").read_text()
    Path("job.toml").write_text(chosen.replace('strategy = "slow"', 'strategy = "long"'))
    refused = run("project", "report", "job.toml", "--out", "other.html", "--budget", "0")
    assert (refused.code, Path("other.html").exists()) == (2, False)
    assert 'strategy "long": its torque changes until 5 s' in refused.err
    Path("job.toml").write_text(text.replace("version = 1", "version = 2"))
    assert run("project", "open", "job.toml").code == 2


def test_optima_are_checked(run, place):
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, name="crane")
    stored = StoredOptimum.of(optimize(drive, 0.2883042), "best", "crane")
    Project.new(drive).with_part(stored).save("job.toml")
    said = run("project", "open", "job.toml", "--check").out
    assert "K_dyn 0.9092: holds" in " ".join(said.split())  # as wide as the terminal is
    Project.new(drive).with_part(stored.replace(claimed=0.8)).save("job.toml")
    ended = run("project", "open", "job.toml", "--check")
    assert ended.code == 3
    assert "0.8 was claimed" in ended.err
