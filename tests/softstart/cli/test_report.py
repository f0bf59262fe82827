"""`softstart report`: the file is written whole or not at all, and bad input is told at once."""

import json
import os

import pytest

CHEAP = ("--controllers", "direct,ramp", "--budget", "0")


def test_report_is_written_and_summed_up(run, place):
    code, out, err = run(
        "report", "good.toml", *CHEAP, "--out", "r.html", "--json", "--resolution", "time=5ms"
    )
    assert (code, err) == (0, "")
    made = json.loads(out)
    page = (place / "r.html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert made["recommended"] is None  # the file has no limits
    assert made["chosen"] == "ramp"
    assert f"{made['k_dyn']:.3f}" in page
    assert "softstart report good.toml" in page
    assert made["provenance"]["command"].startswith("softstart report good.toml")
    time = next(one for one in made["sheets"][0]["settings"] if one["name"] == "time")
    assert time["rounded"] == 0.11
    assert not list(place.rglob("*.part"))


def test_interrupted_report_leaves_the_old_file(run, place, monkeypatch):
    (place / "r.html").write_text("old")

    def stop(report):
        raise KeyboardInterrupt

    monkeypatch.setattr("softstart.reporting.result.Report.to_html", stop)
    code, out, err = run("report", "good.toml", *CHEAP, "--out", "r.html")
    assert (code, out) == (130, "")
    assert "interrupted" in err
    assert (place / "r.html").read_text() == "old"
    assert not list(place.rglob("*.part"))


def test_numbers_for_people_without_a_file_are_refused_and_all_mistakes_told(run, nothing_left):
    code, out, err = run("report", "nowhere.toml", "--resolution", "tme=1ms", "--budget", "x")
    assert (code, out) == (2, "")
    for words in (
        "--out: name the file",
        "no such file",
        "did you mean time?",
        "--budget",
    ):
        assert words in err
    assert "4 things are wrong" in err
    nothing_left()


def test_a_project_that_is_wrong_is_told_before_anything_is_computed(run, place):
    code, out, err = run("report", "good.toml", *CHEAP, "--out", "r.html", "--project", "nowhere.toml")
    assert (code, out) == (2, "")
    assert "no such file" in err
    (place / "about.toml").write_text('[project]\npapr = "A4"')
    code, out, err = run("report", "good.toml", *CHEAP, "--out", "r.html", "--project", "about.toml")
    assert (code, out) == (2, "")
    assert "did you mean paper?" in err
    assert not (place / "r.html").exists()


def test_a_pipe_or_device_is_not_replaced(run, place):
    pipe = place / "pipe"
    os.mkfifo(pipe)
    code, out, err = run("report", "good.toml", *CHEAP, "--out", "pipe")
    assert (code, out) == (2, "")
    assert "no ordinary file" in err
    assert pipe.is_fifo()


@pytest.mark.parametrize(
    ("out", "says"),
    [("folder", "is a folder"), ("gone/r.html", "cannot be written"), ("", "name of a file")],
)
def test_a_place_that_cannot_be_written_is_told_first(run, nothing_left, out, says):
    code, stdout, err = run("report", "good.toml", "--out", out)
    assert (code, stdout) == (2, "")
    assert err.count("\n") == 1
    assert says in err
    nothing_left()


def test_without_a_browser_the_pdf_is_refused_before_anything_is_computed(run, monkeypatch, nothing_left):
    monkeypatch.delenv("SOFTSTART_CHROMIUM", raising=False)
    monkeypatch.setenv("PATH", "")
    code, out, err = run("report", "good.toml", *CHEAP, "--pdf", "r.pdf")
    assert (code, out) == (2, "")
    assert "apt-get install chromium" in err
    monkeypatch.setenv("SOFTSTART_CHROMIUM", "no-such-browser")
    code, out, err = run("report", "good.toml", *CHEAP, "--pdf", "r.pdf")
    assert (code, out) == (2, "")
    assert 'SOFTSTART_CHROMIUM = "no-such-browser": there is no such program' in err
    nothing_left()


@pytest.mark.skipif(os.name != "posix", reason="needs the program false")
def test_a_browser_that_does_not_print_is_named(run, monkeypatch, nothing_left):
    monkeypatch.setenv("SOFTSTART_CHROMIUM", "false")
    code, out, err = run("report", "good.toml", *CHEAP, "--pdf", "r.pdf")
    assert (code, out) == (2, "")
    assert "--pdf: false did not print (exit code 1); print the HTML file of --out instead." in err
    nothing_left()


def test_a_chain_has_a_report_of_its_own(run, place):
    """With the sheet of its strategy, in the steps that were given."""
    code, out, err = run(
        "report", "crane-4-mass", "--controllers", "direct,ramp", "--budget", "0", "--resolution", "time=5ms",
        "--out", "r.html", "--json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    made = json.loads(out)
    assert made["chosen"] == "ramp"
    (sheet,) = made["sheets"]
    times = [one["rounded"] for one in sheet["settings"] if one["name"] == "time"]
    assert [1e3 * one % 5 for one in times] == [0.0]
    assert "1. The strategies compared" in (place / "r.html").read_text(encoding="utf-8")
