"""Every kind of bad input: clear sentences on standard error, exit 2, nothing on standard output, no file."""

import shlex
import subprocess
import sys

import pytest

from softstart.errors import SimulationError

START = "simulate crane-4amtkf --controller "
RAMP = "tune --controller ramp --gaps 0.5,2 --inertias 2J1,5J1 --restarts 1 --workers 1 --no-optimum "
GRID = "sweep --controller ramp --axis shaft.gap=0.5,1 "

# what is typed, and what the one sentence must say
REFUSED = [
    # the command line
    ("compre", '"compre"', "did you mean softstart compare?"),
    ("zzzzzz", "there are init, plan, identify, wear, drives, reduce, compare,", "study and completion"),
    ("compare --jsno", "compare:", "'--jsno'", "Did you mean '--json'?"),
    ("simulate good.toml", "Missing option '--controller'"),
    ("report good.toml --pdf --json", "--pdf", "this is an option"),
    # the machine
    ("compare nowhere.toml", '"nowhere.toml"', "no such file"),
    ("plan crane-4-mass", "this is a chain", "softstart reduce crane-4-mass --out DIR"),
    ("compare --until 0", '--until = "0"', "above 0 s"),
    # controllers and their parameters
    ("compare --controllers direct,,ramp", '--controllers = ""', "there are"),
    ("compare --controllers ramp,ramp", "named twice"),
    (START + "ramp --param time", "--param", "equals sign"),
    (START + "ramp --param tim=1", "--param tim = 1", "time"),
    (START + "ramp --param time=1 --param time=2", "given twice"),
    ("compare --param time=1", "CONTROLLER.key=value"),
    ("compare --controllers direct --param ramp.time=1", "ramp is not compared here"),
    ("simulate good.toml --controller long.csv", "until 60 s", "correct the unit of its time"),
    ("compare good.toml --controllers direct,long.csv", 'strategy "long"', "has ended at"),
    # --out
    *((f"{command} --out good.toml", "is a file, not a folder") for command in ("compare", "optimize", GRID)),
    (START + "direct --out ''", "name of the folder is empty"),
    (START + "direct --out 'a\0b'", "cannot be the path"),
    (START + "direct --out " + 300 * "x", "--out"),
    ("study --out here", "a list writes no files"),
    # optimize and pareto
    ("optimize --start-time=-2x", '"-2x"', "a multiple"),
    ("optimize --terminal steedy", "--terminal", "'synchronous', 'steady', 'reached'"),
    ("optimize --start-time 1x --torque-speed 62", "--torque-speed", "speed:torque"),
    ("optimize --torque-speed 0:62,90:-5", "--torque-speed", "-5 N m at 90 rad/s", "0 or more"),
    ("optimize --start-time 1x --smoothness -1", "--smoothness", "0 or more"),
    ("optimize --start-time 1.2x --gaps 0.5,,1", "--gaps", "empty"),
    ("pareto --start-times ''", "--start-times", "empty"),
    ("pareto --start-times 0.3:0.4", "from:to:count"),
    ("pareto --start-times 0.3:1.2x:5", "both ends"),
    ("pareto --controllers profile", "profile"),
    ("sweep --controller ramp --axis gap=0.5,1 --workers none", "--workers", "a whole number of 1 or more"),
    # tune
    (RAMP + "--inertias 2J1:0.2:4", "--inertias", "both"),
    (RAMP + "--free time=3", "name=low:high"),
    (RAMP + "--free time=3:1", "time = 3:1: give its lowest"),
    (RAMP + "--tolerance stiffness", "as stiffness=10%"),
    (RAMP + "--controller ramp,shaped", "give one controller", "once for each"),
    # sweep
    ("sweep --axis gap=0.5,1", "--controller = None: name one"),
    (GRID + "--axis gap", '--axis "gap": write a key'),
    (GRID + "--axis load.inertia=1:2:many", "--axis load.inertia", "from 2 to 1,000,000"),
    (GRID + "--axis load.kind=active:reactive:2", "commas between"),
    (GRID + "--workers 2 --scheduler tcp://x:1", "--workers", "one of"),
    (GRID + "--netcdf no/where.nc", "--netcdf = no/where.nc"),
    # reduce and plan
    ("reduce --factor 0.5", "--factor = 0.5"),
    ("reduce --verify ramp --no-starts", "give one of the two"),
    ("plan crane-4amtkf --set load.kind=reactive --wanted gpa", "no parameter that this plan can tell"),
    # clutch
    ("clutch paper-d", "no shipped clutch of this name", "did you mean paper-c?"),
    ("clutch --law linaer", '--law = "linaer"', "did you mean linear?"),
    ("clutch --optimal --until 3", "leave it out with --optimal"),
    # reports, the page and the shell
    ("report good.toml --out folder", "is a folder"),
    ("serve --expose", "--host ADDRESS and --token TOKEN"),
    ("completion fsh", 'shell = "fsh"'),
]  # fmt: skip


@pytest.mark.parametrize(("line", "says"), [(line, says) for line, *says in REFUSED])
def test_one_clear_sentence(line, says, refused):
    words = shlex.split(line)
    refused(*words, says=says, prints=words[0] == "reduce")  # natural frequencies come first


def test_several_mistakes_are_told_at_once(refused):
    refused("compare", "wrong.toml", says=["starting_torque", "gap = nan"], mistakes=2)
    says = ["[motor]", "[clutch] inertia", "[clutch] torque", "[clutch] speed", "time tM"]
    refused("clutch", "good.toml", says=says, mistakes=5)


@pytest.mark.parametrize(
    ("controller", "says"), [("Raises", "ZeroDivisionError"), ("Leaves", "SystemExit: 7")]
)
@pytest.mark.parametrize("command", ["simulate --controller", "compare --controllers"])
def test_a_start_that_cannot_be_finished(controller, says, command, run, nothing_left):
    name, option = command.split()
    code, out, err = run(name, "good.toml", option, f"own.py:{controller}", "--json", "--out", "results")
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("softstart: The start was given up: ")
    assert "own.py, line" in err
    assert says in err
    nothing_left()


FAILURES = {
    "memory": (MemoryError(), 3, "there is not enough memory for this."),
    "unfinished": (SimulationError("The start cannot be finished."), 3, "The start cannot be finished."),
    "disk": (OSError(28, "No space left on device"), 2, "could not be written: No space left on device."),
    "stopped": (KeyboardInterrupt(), 130, "interrupted; no incomplete file was left behind."),
}


@pytest.mark.parametrize("name", FAILURES)
def test_how_a_command_fails_is_its_exit_code(name, run, nothing_left, monkeypatch):
    """Nothing on standard output, one sentence, no file."""
    error, code, says = FAILURES[name]

    def fail(*_, **__):
        raise error

    monkeypatch.setattr("softstart.simulate", fail)
    monkeypatch.setattr("softstart.start.comparison.simulate", fail)
    for line in ("simulate good.toml --controller direct", "compare good.toml --json --out results"):
        ended = run(*line.split())
        assert (ended.code, ended.out) == (code, "")
        assert ended.err.startswith("softstart: ")
        assert ended.err.endswith(f"{says}\n")
    nothing_left()


def test_a_mistake_of_softstart_itself_shows_no_traceback(place):
    program = (
        "import sys; import softstart.cli.commands as commands; commands.print = None; "
        "from softstart.cli import main; sys.exit(main())"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert "this is a bug in softstart" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_without_a_browser_no_pdf(monkeypatch, refused):
    monkeypatch.setenv("PATH", "")
    for browser, says in (
        (None, "apt-get install chromium"),
        ("no-such-browser", 'SOFTSTART_CHROMIUM = "no-such-browser": there is no such program'),
        ("/bin/false", "PDF: /bin/false did not print (exit code 1). Print the HTML file of --out"),
    ):
        monkeypatch.delenv("SOFTSTART_CHROMIUM", raising=False)
        if browser:
            monkeypatch.setenv("SOFTSTART_CHROMIUM", browser)
        cheap = ("--controllers", "direct,ramp", "--budget", "0")
        refused("report", "good.toml", *cheap, "--pdf", "r.pdf", says=[says])
