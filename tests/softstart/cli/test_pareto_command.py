"""`softstart pareto`: the tables, the JSON, the files, and going on after an interruption."""

import csv
import json
import os

import pytest
from tests.kept import parts_in

from softstart import Drive, simulate
from softstart.optimal.front import pareto

SIXTY = ("--set", "start.target_speed=60 rad/s")
TWO = ("pareto", *SIXTY, "--start-times", "0.2523,0.3", "--controllers", "ramp")
THREE = ("pareto", *SIXTY, "--start-times", "0.2,0.2523,0.3", "--controllers", "ramp")
CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A front and the file of its finished points."""
    path = tmp_path_factory.mktemp("finished") / "pareto.sqlite"
    return pareto(CRANE, [0.2, 0.2523, 0.3], controllers=["ramp"], save_to=path), path.read_bytes()


@pytest.fixture
def begun(place, finished):
    """A folder that holds these points already."""
    (place / "front").mkdir()
    (place / "front" / "pareto.sqlite").write_bytes(finished[1])
    return "front"


def test_json_is_the_summary_of_the_front(begun, finished, as_json):
    told = as_json(*THREE, "--out", begun)
    assert told == json.loads(json.dumps(finished[0].summary()))


def test_without_a_folder_all_is_computed(finished, as_json):
    told = as_json(*TWO)
    for point, other in zip(told["points"], finished[0].points[1:], strict=True):
        assert point["k_dyn"] == pytest.approx(other.k_dyn, rel=1e-9)
    assert told["shortest_start_time"] is None


def test_ranges_of_multiples_and_times(run):
    direct = simulate(CRANE, "direct").start_time
    code, out, _ = run("pareto", *SIXTY, "--start-times", "1.2x:1.4x:2", "--controllers", "ramp", "--json")
    assert code == 0
    bounds = [point["start_time_bound"] for point in json.loads(out)["points"]]
    assert bounds == pytest.approx([1.2 * direct, 1.4 * direct])


def test_the_tables_are_shown_and_fit(begun, table):
    flat = table(*THREE, "--out", begun)
    for words in (
        "Least K_dyn, terminal reached",
        "infeasible",
        "Nearest to the limit: ramp",
        "times",
        "bound",
    ):
        assert words in flat


FILES = {"report.md", "pareto.csv", "pareto.sqlite", "pareto.svg", "pareto.png", "drive.toml"}


def test_the_files(run, place, done):
    out = done(*TWO, "--out", "deep/front")
    assert out.splitlines()[-1].startswith("Written to deep/front: ")
    folder = place / "deep" / "front"
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in (place / "deep").iterdir()] == ["front"]
    assert (folder / "pareto.png").read_bytes().startswith(b"\x89PNG")
    with (folder / "pareto.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["what"] for row in rows] == ["optimum", "optimum", "ramp"]
    report = (folder / "report.md").read_text("utf-8")
    assert {part.split(")")[0] for part in report.split("](")[1:]} <= FILES
    assert "--start-times 0.2523,0.3 --controllers ramp --out deep/front" in report
    assert "| ramp |" in report

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(*TWO, "--out", "deep/front").code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_points_of_another_drive_are_refused(place, begun, refused):
    before = {path.name: path.read_bytes() for path in (place / "front").iterdir()}
    said = refused(*TWO, "--set", "gap=0.6", "--out", "front")
    for words in ("--out", "pareto.sqlite", "another drive", "give another folder"):
        assert words in said
    assert {path.name: path.read_bytes() for path in (place / "front").iterdir()} == before


@pytest.mark.slow
def test_who_computes_changes_nothing(run, finished):
    assert {point.method for point in finished[0].points if point.found} == {"closed-form", "descent"}

    def told(found):
        return [{**point, "seconds": None} for point in found["points"]], found["controllers"]

    arguments = (*THREE, "--json")
    assert told(json.loads(run(*arguments, "--workers", "2").out)) == told(
        json.loads(json.dumps(finished[0].summary()))
    )
    code, out, err = run(*arguments, "--workers", "none")
    assert (code, out) == (2, "")
    assert err == 'softstart: --workers = "none": give a whole number of 1 or more.\n'


def test_no_feasible_start_time(run):
    code, out, err = run("pareto", *SIXTY, "--start-times", "0.1,0.2", "--controllers", "ramp", "--json")
    assert code == 3
    assert err.count("\n") == 1
    assert "within 0.2 s" in err
    told = json.loads(out)
    assert [point["status"] for point in told["points"]] == ["INFEASIBLE", "INFEASIBLE"]
    assert 0.2 < told["shortest_start_time"] < 0.26


def test_an_interrupted_command_keeps_its_points_and_goes_on(interrupted, place, run):
    state = place / "front" / "pareto.sqlite"
    err = interrupted(
        "pareto", *SIXTY, "--start-times", "0.245:0.4:40", "--controllers", "direct", "--out", "front",
        begun=lambda: len(parts_in(state)) > 1,
    )  # fmt: skip
    assert "finished points are kept in front/pareto.sqlite" in err
    assert os.listdir(place / "front") == ["pareto.sqlite"]
    assert not list(place.rglob("*.part"))
    kept = parts_in(state)
    assert kept
    few = ",".join(repr(one["start_time_bound"]) for one in kept[:2])
    code, out, _ = run(
        "pareto", *SIXTY, "--start-times", few, "--controllers", "ramp", "--out", "front", "--json"
    )
    assert code == 0
    seconds = {point["start_time_bound"]: point["seconds"] for point in json.loads(out)["points"]}
    assert seconds == {one["start_time_bound"]: one["seconds"] for one in kept[:2]}  # not computed again


ONE_SENTENCE = {
    "no time": (["--start-times", ""], ["--start-times", "empty"]),
    "zero": (["--start-times", "0.3,0"], ['--start-times = "0"', "above 0 s"]),
    "half a range": (["--start-times", "0.3:0.4"], ["from:to:count"]),
    "count of one": (["--start-times", "0.3:0.4:1"], ["from 2 to 1000"]),
    "count of a word": (["--start-times", "0.3:0.4:many"], ["from 2 to 1000"]),
    "mixed range": (["--start-times", "0.3:1.2x:5"], ["both ends"]),
    "terminal": (["--terminal", "steedy"], ["--terminal", "'synchronous', 'steady', 'reached'"]),
    "controller": (["--controllers", "dirct"], ["did you mean direct?"]),
    "a controller that needs a parameter": (["--controllers", "profile"], ["profile"]),
}


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("pareto", *arguments, says=says)
