"""Every kind of bad input: clear sentences on standard error, exit 2, nothing on standard output, no file."""

import shlex
import subprocess
import sys

import pytest

from softstart import Drive, InputError, compare
from softstart.study import find_study

START = "simulate crane-4amtkf --controller "
RAMP = "tune --controller ramp --gaps 0.5,2 --inertias 2J1,5J1 --restarts 1 --workers 1 --no-optimum "
LIMITED = "optimize --limits --set limits.shaft_torque='50 N*m' "
GRID = "sweep --controller ramp --axis shaft.gap=0.5,1 "
LOG = "identify a.csv --drive crane-4amtkf "

# what is typed, and what the one sentence must say
REFUSED = [
    # the command line
    ("compre", '"compre"', "did you mean softstart compare?"),
    ("zzzzzz", "there are init, plan, identify, wear, drives, reduce, compare,", "study and completion"),
    ("compare --jsno", "compare:", "'--jsno'", "Did you mean '--json'?"),
    ("compare --set", "compare:", "'--set' requires an argument"),
    ("compare --json=yes", "'--json' does not take a value"),
    ("compare good.toml good.toml", "compare:", "extra argument"),
    ("simulate --controller direct", "Missing argument 'DRIVE'"),
    ("sweep --controller ramp", "Missing option '--axis'"),
    ("report good.toml --pdf --json", "--pdf", "this is an option"),
    # the machine
    ("compare nowhere.toml", '"nowhere.toml"', "no such file"),
    ("compare folder", "directory"),
    ("compare broken.toml", "line 1", "not valid TOML"),
    ("compare latin.toml", "latin.toml", "UTF-8"),
    ("compare deep.toml", "deep.toml: line 1", "keys are nested too deeply"),
    ("compare misspelt.toml", "stifness", "did you mean stiffness?"),
    ("compare weak.toml", "starting_torque", "7.16"),
    ("compare list.toml", "[shaft] gap = [0.5, 1.0]: a drive has one value", "use sweep"),
    ("plan crane-4-mass", "this is a chain", "softstart reduce crane-4-mass --out DIR"),
    ("simulate good.toml --controller ramp --fitted-to nowhere.toml", "there is no such file"),
    *(
        (f"{command} crane-4amtk", "did you mean crane-4amtkf?")
        for command in ("compare", "optimize", "pareto", RAMP, GRID, "linear --controller ramp", "fatigue")
    ),
    # --set and --until
    ("compare --set gap=1 --set gap=2", "set before"),
    ("compare --set 'shaft.gap=2 m'", "m is a length, not an angle"),
    (START + "direct --set 'gap=[1, 2]'", "gap"),
    ("compare --until 0", '--until = "0"', "above 0 s"),
    ("compare --until '5 rad/s'", "not a time"),
    # controllers and their parameters
    ("compare --controllers dirct", "--controllers", "did you mean direct?"),
    (START + "zzzzzz", "--controller", "there are"),
    ("compare --controllers direct,,ramp", '--controllers = ""', "there are"),
    ("compare --controllers ramp,ramp", "named twice"),
    (START + "profile", "--param file=PATH"),
    (START + "ramp --param time", "--param", "equals sign"),
    (START + "ramp --param tim=1", "--param tim = 1", "time"),
    (START + "ramp --param time=1 --param time=2", "given twice"),
    ("compare --param time=1", "CONTROLLER.key=value"),
    ("compare --controllers direct --param ramp.time=1", "ramp is not compared here"),
    # controllers in files
    (START + "gone.py:Good", "gone.py: there is no such file"),
    (START + "own.py:God", "no class God", "Good"),
    (START + "own.py", "say which class"),
    (START + "only.py:X", "does not run", "own_missing_module"),
    (START + "syntax.py:X", "does not run", "SyntaxError"),
    (START + "quits.py:X", "does not run", "SystemExit"),
    (START + "own.py:NoController", "derive the class"),
    (START + "own.py:Hollow", "step"),
    (START + "own.py:Text", "answer with Command"),
    # --out
    *((f"{command} --out good.toml", "is a file, not a folder") for command in ("compare", "optimize", GRID)),
    (START + "direct --out /proc/softstart", "nothing can be written there"),
    (START + "direct --out ''", "name of the folder is empty"),
    (START + "direct --out 'a\0b'", "cannot be the path"),
    (START + "direct --out " + 300 * "x", "--out"),
    ("study --out here", "a list writes no files"),
    # optimize and pareto
    ("optimize --start-time 0", '--start-time = "0"', "above 0 s"),
    ("optimize --start-time=-2x", '"-2x"', "a multiple"),
    ("optimize --terminal steedy", "--terminal", "'synchronous', 'steady', 'reached'"),
    ("optimize --start-time 1.2x --minimise kdyn", "--minimise", "'k_dyn', "),
    ("optimize --start-time 1.2x --max-k-dyn 1", "--max-k-dyn", "is what is minimised"),
    ("optimize --minimise start_time --start-time 1", "--start-time", "what is minimised"),
    ("optimize --start-time 1x --torque-speed 62", "--torque-speed", "speed:torque"),
    ("optimize --start-time 1x --torque-speed 0:62,10:20,90:10", "--torque-speed", "bends"),
    ("optimize --start-time 1x --smoothness -1", "--smoothness", "0 or more"),
    ("optimize --start-time 1.2x --gaps 0.5,,1", "--gaps", "empty"),
    ("optimize --start-time 1.2x --gaps 1 --terminal steady", "--terminal"),
    ("optimize --limits", "--limits: Crane travel drive"),
    (LIMITED + "--start-time 1.2x", "--start-time: limits asks for the least start time"),
    ("pareto --start-times ''", "--start-times", "empty"),
    ("pareto --start-times 0.3:0.4", "from:to:count"),
    ("pareto --start-times 0.3:1.2x:5", "both ends"),
    ("pareto --controllers profile", "profile"),
    ("pareto --start-times 0.3,0.4 --workers none", '--workers = "none": give a whole number of 1 or more.'),
    # tune
    (RAMP + "--inertias 2J1:0.2:4", "--inertias", "both"),
    (RAMP + "--free tme", "--free", "did you mean time?"),
    (RAMP + "--free time=3", "name=low:high"),
    (RAMP + "--free time=3:1", "time = 3:1: give its lowest"),
    (RAMP + "--tolerance stiffness", "as stiffness=10%"),
    (RAMP + "--quantile 2", "--quantile"),
    (RAMP + "--controller ramp,shaped", "give one controller", "once for each"),
    (RAMP + "--controller good.toml", "no tuned gains"),
    (RAMP + "--controller direct", "no parameter to tune", "as --free torque=0.5x:2x."),
    # sweep
    ("sweep --axis gap=0.5,1", "--controller = None: name a"),
    ("sweep --axis controller=direct,rmp", "--axis controller", "did you mean ramp?"),
    (GRID + "--axis gap", '--axis "gap": write a key'),
    (GRID + "--axis gapp=1,2", "--axis gapp: there is no such axis", "gap?"),
    (GRID + "--axis load.inertia=1:2:many", "--axis load.inertia", "from 2 to 1,000,000"),
    (GRID + "--axis load.kind=active:reactive:2", "commas between"),
    (GRID + "--axis gap=2", "by its other name"),
    (GRID + "--axis 'load.torque=5, 70'", "load_torque = 70 N*m"),
    (GRID + "--workers 2 --scheduler tcp://x:1", "--workers", "one of"),
    (GRID + "--figures k_dym", "--figures", "did you mean k_dyn?"),
    (GRID + "--netcdf no/where.nc", "--netcdf = no/where.nc"),
    ("sweep --controller ramp --axis gap=0:1:1000000 --axis damping=0:1:1000", "1,000,000,000 starts"),
    # reduce, fatigue, identify
    ("reduce --set start.load=rotor", "motor and load are the same mass"),
    ("reduce --factor 0.5", "--factor = 0.5"),
    ("reduce --verify ramp --no-starts", "give one of the two"),
    ("fatigue", "damping is missing in motor - load: an undamped shaft rattles without end"),
    ("fatigue --estimate-damping teeth=3", "give numbers of gears and couplings"),
    ("fatigue --set shaft.damping=1 --worn-gap 0.1", "wear widens the gap"),
    ("fatigue --set shaft.damping=1 --estimate-damping gears=3", "a damping of its own"),
    ("identify nowhere.csv --drive crane-4amtkf", "there is no such file"),
    (LOG + "--torque-is guess", "'--torque-is': 'guess' is not one of 'measured', 'demand'."),
    ("plan crane-4amtkf --set load.kind=reactive --wanted gpa", "no parameter that this plan can tell"),
    ("wear NOFOLDER ALSO --dates 2025-01-01,2026-01-01", "NOFOLDER/identification.json: there is no such"),
    # clutch and balance
    ("clutch paper-d", "no shipped clutch of this name", "did you mean paper-c?"),
    ("clutch --law linaer", '--law = "linaer"', "did you mean linear?"),
    ("clutch --set shaft.stiffness=1e20", "stiffness = 1e+20", "must be between 1e-09 and"),
    ("clutch --optimal --until 3", "leave it out with --optimal"),
    ("clutch --optimal --set shaft.gap=0.1", "gap = 0.1", "set gap = 0"),
    ("balance --speed '50 Hz'", "--speed", "Hz is a frequency"),
    ("balance --speed 4500", '"4500": no unit; write "4500 rpm" or, if rad/s is meant'),
    # reports, the page and the shell
    ("report good.toml --out folder", "is a folder"),
    ("report good.toml --out gone/r.html", "cannot be written"),
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


UNFINISHED = {
    "own.py:Raises": ["own.py, line", "ZeroDivisionError"],
    "own.py:Leaves": ["own.py, line", "SystemExit: 7"],
    "own.py:Nan": ["NaN", "Nan"],
    "own.py:Past": ["past instant"],
}


@pytest.mark.parametrize("controller", UNFINISHED)
@pytest.mark.parametrize("command", ["simulate --controller", "compare --controllers"])
def test_a_start_that_cannot_be_finished(controller, command, run, nothing_left):
    name, option = command.split()
    code, out, err = run(name, "good.toml", option, controller, "--json", "--out", "results")
    assert (code, out) == (3, "")
    assert err.startswith("softstart: The start was given up: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    for words in UNFINISHED[controller]:
        assert words in err
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


def test_in_python_they_are_errors_with_the_same_sentences():
    with pytest.raises(InputError, match="fitted_to: give the one Drive"):
        compare(Drive.load("crane-4amtkf"), ["direct"], fitted_to="good.toml")
    with pytest.raises(InputError, match='did you mean "paper-g"'):
        find_study("papr-g")


def test_without_a_browser_no_pdf(monkeypatch, refused):
    monkeypatch.setenv("PATH", "")
    for browser, says in (
        (None, "apt-get install chromium"),
        ("no-such-browser", 'SOFTSTART_CHROMIUM = "no-such-browser": there is no such program'),
        ("/bin/false", "--pdf: /bin/false did not print (exit code 1); print the HTML file of --out"),
    ):
        monkeypatch.delenv("SOFTSTART_CHROMIUM", raising=False)
        if browser:
            monkeypatch.setenv("SOFTSTART_CHROMIUM", browser)
        cheap = ("--controllers", "direct,ramp", "--budget", "0")
        refused("report", "good.toml", *cheap, "--pdf", "r.pdf", says=[says])
