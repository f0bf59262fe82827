"""`softstart report`: the file is written whole or not at all, and bad input is told at once."""

import os

import pytest

CHEAP = ("--controllers", "direct,ramp", "--budget", "0")


def test_report_is_written_and_summed_up(place, as_json):
    made = as_json("report", "good.toml", *CHEAP, "--out", "r.html", "--resolution", "time=5ms")
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


def test_a_project_that_is_wrong_is_told_before_anything_is_computed(place, refused):
    said = refused("report", "good.toml", *CHEAP, "--out", "r.html", "--project", "nowhere.toml")
    assert "no such file" in said
    (place / "about.toml").write_text('[project]\npapr = "A4"')
    said = refused("report", "good.toml", *CHEAP, "--out", "r.html", "--project", "about.toml")
    assert "did you mean paper?" in said
    assert not (place / "r.html").exists()


def test_a_pipe_or_device_is_not_replaced(place, refused):
    pipe = place / "pipe"
    os.mkfifo(pipe)
    refused("report", "good.toml", *CHEAP, "--out", "pipe", says=["no ordinary file"])
    assert pipe.is_fifo()


@pytest.mark.parametrize(
    ("out", "says"), [("folder", "is a folder"), ("gone/r.html", "cannot be written"), ("", "name of a file")]
)
def test_a_place_that_cannot_be_written_is_told_first(out, says, refused):
    refused("report", "good.toml", "--out", out, says=[says])


def test_without_a_browser_the_pdf_is_refused_before_anything_is_computed(monkeypatch, refused):
    monkeypatch.delenv("SOFTSTART_CHROMIUM", raising=False)
    monkeypatch.setenv("PATH", "")
    refused("report", "good.toml", *CHEAP, "--pdf", "r.pdf", says=["apt-get install chromium"])
    monkeypatch.setenv("SOFTSTART_CHROMIUM", "no-such-browser")
    said = refused("report", "good.toml", *CHEAP, "--pdf", "r.pdf")
    assert 'SOFTSTART_CHROMIUM = "no-such-browser": there is no such program' in said


@pytest.mark.skipif(os.name != "posix", reason="needs the program false")
def test_a_browser_that_does_not_print_is_named(monkeypatch, refused):
    monkeypatch.setenv("SOFTSTART_CHROMIUM", "false")
    said = refused("report", "good.toml", *CHEAP, "--pdf", "r.pdf")
    assert "--pdf: false did not print (exit code 1); print the HTML file of --out instead." in said


def test_a_chain_has_a_report_of_its_own(place, as_json):
    """With the sheet of its strategy, in the steps that were given."""
    made = as_json("report", "crane-4-mass", *CHEAP, "--out", "r.html", "--resolution", "time=5ms")
    assert made["chosen"] == "ramp"
    (sheet,) = made["sheets"]
    times = [one["rounded"] for one in sheet["settings"] if one["name"] == "time"]
    assert [1e3 * one % 5 for one in times] == [0.0]
    assert "4. What each shaft carries" in (place / "r.html").read_text(encoding="utf-8")
