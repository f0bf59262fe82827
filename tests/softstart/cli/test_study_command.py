"""`softstart study`, and what a study is."""

from importlib.metadata import EntryPoint

import pytest

from softstart import InputError, SimulationError, plugins
from softstart.cli import lists
from softstart.study import Claim, Study, StudyResult, Table, Verdict, find_study
from softstart.views.drawing import new_figure


class Example(Study):
    name = "example"
    title = "Does a wider gap raise K_dyn?"
    pictures = ("gap",)

    def run(self, out, progress):
        progress("asking")
        figure, axes = new_figure()
        axes.plot([0.5, 2.0], [3.1179, 4.8654])
        rows = [(0.5, 3.1179, "[G]"), (2.0, None, "")]
        return StudyResult(
            tables=[Table("Peak over gap", ("gap, rad", "K_dyn", "note"), rows)],
            claims=[
                Claim("A wider gap raises K_dyn.", "confirmed", "3.12 at 0.5 rad, 4.87 at 2 rad."),
                Claim("Nothing else does.", Verdict.REFUTED, "A larger J2 does too. " * 12),
            ],
            figures={"gap": figure},
        )


class Fails(Example):
    name = "fails"

    def run(self, out, progress):
        (out / "begun.txt").write_text("half")
        raise SimulationError("The start was given up: its controller is a test.")


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    places = {"example": f"{__name__}:Example", "fails": f"{__name__}:Fails", "broken": "nothing:Study",
              "strange": "builtins:int"}  # fmt: skip
    points = {name: EntryPoint(name, place, "softstart.studies") for name, place in places.items()}
    monkeypatch.setattr(lists, "registered", lambda group: points)
    monkeypatch.setattr(plugins, "registered", lambda group: points)


def test_a_study_is_listed_shown_and_written(done, as_json, place):
    assert "No module named 'nothing'" in " ".join(done("study").split())
    listed = {"name": "example", "title": Example.title, "pictures": ["gap"], "files": ["gap.svg", "gap.png"]}
    assert listed in as_json("study")["studies"]
    out = done("study", "example", "--out", "results")
    for words in ("Peak over gap", "3.1179", " 1. confirmed  A wider gap", " 2. refuted    Nothing", "[G]"):
        assert words in out
    assert max(map(len, out.splitlines())) <= 100
    told = as_json("study", "example")
    assert [claim["verdict"] for claim in told["claims"]] == ["confirmed", "refuted"]
    assert told["tables"][0]["rows"] == [[0.5, 3.1179, "[G]"], [2.0, None, ""]]
    names = {path.name for path in (place / "results").iterdir()}
    assert names == {"gap.svg", "gap.png", "peak-over-gap.csv", "claims.csv", "report.md"}
    table = (place / "results" / "peak-over-gap.csv").read_text("utf-8")
    assert table == '"gap, rad",K_dyn,note\n0.5,3.1179,[G]\n2.0,,\n'


def test_a_study_that_fails_leaves_nothing(run, nothing_left):
    code, out, err = run("study", "fails", "--out", "results")
    assert (code, out) == (3, "")
    assert err == "softstart: The start was given up: its controller is a test.\n"
    nothing_left()


@pytest.mark.parametrize(
    ("name", "says"),
    [("exampel", 'did you mean "example"'), ("broken", "cannot be loaded"), ("strange", "is no study")],
)
def test_studies_that_are_not_there(name, says):
    with pytest.raises(InputError, match=says):
        find_study(name)


def test_mistakes_in_a_result_are_found_at_once():
    with pytest.raises(ValueError, match="2 cells for 1 columns"):
        Table("t", ("a",), [(1, 2)])
    with pytest.raises(ValueError, match="perhaps"):
        Claim("s", "perhaps", "e")
