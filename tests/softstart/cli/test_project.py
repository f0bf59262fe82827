"""`softstart project`: new, open and report, and their refusals."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from softstart import DataSheet, Drive, Duty, optimize
from softstart.errors import InputError
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


OF_MACHINES = [
    "compare FILE", "compare crane-4amtkf FILE", "simulate FILE --controller ramp",
    "sheet FILE --controller ramp", "report FILE --json", "optimize FILE", "tune FILE --controller ramp",
    "linear FILE --controller ramp", "compare crane-4amtkf --fitted-to FILE",
]  # fmt: skip
OF_OTHERS = ["init FILE", "reduce FILE --out z", "clutch FILE", "balance FILE"]
EMPTY = "version = 1\n[choice]\n"


@pytest.mark.parametrize(
    ("command", "kind", "text", "remedy"),
    [
        *((one, "project", EMPTY, '"softstart project open FILE" opens it') for one in OF_OTHERS),
        *((one, "strategy", SLOW, "--controllers FILE") for one in OF_MACHINES + OF_OTHERS),
        *((one, "duty", '[[duty]]\ndo = "start"\n', "--duty FILE") for one in OF_MACHINES + OF_OTHERS),
    ],
)
def test_a_file_of_another_kind_is_told_in_one_sentence(command, kind, text, remedy, run, place):
    Path("job.toml").write_text(text)
    ended = run(*command.replace("FILE", "job.toml").split())
    assert ended.code == 2
    assert ended.err.startswith(f"softstart: job.toml: this is a {kind}, not a")
    assert remedy in ended.err
    assert ended.err.count("\n") == 1


def without_choice(project: Project) -> Project:
    return Project(machines=project.machines)


@pytest.fixture
def kept(place):
    """The file of a drive with limits and units, and a project that has chosen it among others."""
    crane = Drive.load("crane-4amtkf").with_settings(
        [
            "limits.shaft_torque=115 N*m",
            "units=rpm, deg",
            "gear.ratio=20",
            "brake.torque=40",
            "name=the crane on site",
        ]
    )
    Path("mine.toml").write_text(crane.to_toml())
    Project.new("hoist-15kw", "mine.toml", "crane-4-mass").replace(machine="mine").save("job.toml")


LONG = [
    "optimize FILE --start-time 0.4", "linear FILE --controller speed-ramp",
    "report FILE --controllers ramp --budget 0",
    "tune FILE --controller ramp --gaps 1x --inertias 1x --only robust --no-optimum --restarts 1",
]  # fmt: skip


@pytest.mark.parametrize(
    "command",
    [
        "compare FILE --controllers ramp,direct --set load.inertia=0.1",
        "compare FILE --worn-gap 1 --controllers ramp", "compare hoist-15kw FILE --controllers ramp",
        "compare crane-4amtkf --fitted-to FILE --controllers ramp", "sheet FILE --controller ramp",
        "simulate FILE --controller ramp --at output", "sweep FILE --axis gap=0.2:0.6:3 --controller ramp",
        "fatigue FILE --controllers ramp --set shaft.damping=0.5",
        *(pytest.param(one, marks=pytest.mark.slow) for one in LONG),
    ],
)  # fmt: skip
def test_a_command_takes_the_machine_that_the_project_has_chosen(command, kept, run):
    answers = []
    for file in ("mine.toml", "job.toml"):
        ended = run(*command.replace("FILE", file).split(), "--json")
        assert ended.code == 0, ended.err
        answers.append((re.sub(r'"(date|seconds)": .*', "", ended.out.replace(file, "FILE")), ended.err))
    assert answers[0] == answers[1]
    assert "sheet" in command or "the crane on site" in answers[0][0]


def test_the_duty_that_is_chosen_is_that_of_the_machine(place, as_json):
    project = Project.new("long-travel-3kw").added("shift", Duty.load("travel-crane"))
    project.replace(duty="shift").save("job.toml")
    words = ("--controller", "ramp", "--cycles", "1", "--set", "duty[2].time=5", "--set", "load.inertia=0.04")
    of_project = as_json("duty", "job.toml", *words)
    assert of_project == as_json("duty", "long-travel-3kw", "--duty", "travel-crane", *words)
    assert of_project != as_json("duty", "job.toml", *words[:4], *words[6:])


def test_a_report_takes_names_and_choice_from_the_project_of_its_machine(kept, run, place, monkeypatch):
    project = Project.open("job.toml").added("slow", SLOW)
    project = project.replace(customer="Harbour Cranes Ltd", strategy="slow", beside="hoist-15kw")
    project.save("job.toml")
    asked = []

    def report(machine, **given):
        names = [one.name for one in given["controllers"]]
        asked.append((machine.name, names, given["project"], given.get("beside")))
        raise InputError("enough")

    monkeypatch.setattr("softstart.reporting.report", report)

    def of(*command: str) -> tuple:
        assert run(*command, "--budget", "0", "--out", "r.html").code == 2
        return asked.pop()

    hoist = Drive.load("hoist-15kw")
    whole = ("the crane on site", ["ramp (slow)"], project, hoist)
    assert of("project", "report", "job.toml") == whole
    assert of("report", "job.toml") == whole
    assert of("report", "--project", "job.toml") == whole  # not the shipped drive
    assert of("report", "job.toml", "--controllers", "s-curve") == (whole[0], ["s-curve"], *whole[2:])
    words = ("--controllers", "s-curve", "--project", "job.toml")
    assert of("report", "hoist-15kw", *words) == (hoist.name, ["s-curve"], project, None)


def test_a_project_of_names_alone_goes_with_any_machine(place, as_json, refused):
    Path("about.toml").write_text('[project]\ncustomer = "Harbour Cranes Ltd"\n')
    words = ("--project", "about.toml", "--budget", "0", "--controllers", "ramp")
    assert as_json("report", *words)["drive"] == as_json("report", "crane-4amtkf", *words)["drive"]
    Path("about.toml").write_text('[project]\ncustomr = "Harbour Cranes Ltd"\n')
    refused("report", *words, says=["about.toml: [project] customr", "did you mean customer?"])


def test_a_chain_and_a_data_sheet_of_a_project_are_read(kept, run, as_json):
    project = Project.open("job.toml")
    project.replace(machine="crane-4-mass").save("job.toml")
    words = ("--controller", "ramp", "--set", "mass[2].inertia=0.01")
    assert as_json("simulate", "job.toml", *words) == as_json("simulate", "crane-4-mass", *words)
    ended = run("compare", "crane-4amtkf", "--fitted-to", "job.toml")
    assert ended.code == 2
    assert 'job.toml: machine "crane-4-mass": this is a chain, and a drive is needed here' in ended.err
    sheet = DataSheet(
        machine="rotor", rated_power=1e3, rated_speed=150, motor_inertia=0.01, output_inertia=0.1, ratio=30,
        coupling_stiffness=900,
    ).to_toml()  # fmt: skip
    Path("sheet.toml").write_text(sheet)
    project.added("sheet", sheet).replace(machine="sheet").save("job.toml")
    words = ("--controller", "ramp", "--json", "--set", "gear.ratio=20")
    one, other = (run("simulate", file, *words) for file in ("sheet.toml", "job.toml"))
    assert (one.code, one.out) == (0, other.out)
    assert 'job.toml: machine "sheet" is a data sheet' in other.err


@pytest.mark.parametrize("command", OF_MACHINES)
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (without_choice, '3 machines ("hoist-15kw", "mine", "crane-4-mass"), and none is chosen; write'),
        (lambda project: Project(), "no machine; load one on the page, or add a table [[machine]]."),
    ],
)
def test_a_project_without_one_machine_says_what_to_do(command, change, says, kept, refused):
    change(Project.open("job.toml")).save("job.toml")
    refused(*command.replace("FILE", "job.toml").split(), says=["job.toml: the project has ", says])


def test_the_only_machine_need_not_be_chosen(place, as_json):
    without_choice(Project.new("hoist-15kw")).save("job.toml")
    one, other = (as_json("simulate", name, "--controller", "ramp") for name in ("job.toml", "hoist-15kw"))
    assert one == other


def test_a_project_that_is_cut_off_is_refused_as_such(kept, refused):
    text = Path("job.toml").read_text()
    Path("job.toml").write_text(text[: len(text) // 2])
    refused("simulate", "job.toml", "--controller", "ramp", says=["job.toml: last line", "is cut off"])


def test_the_page_opens_a_project_as_it_is(kept, refused):
    refused("serve", "job.toml", "--set", "load.inertia=1", says=['--set "load.inertia=1": the page opens'])


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
