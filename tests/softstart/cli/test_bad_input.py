"""Every kind of bad input: clear sentences on standard error, exit 2, nothing on standard output, no file."""

import subprocess
import sys

import pytest

START = ("simulate", "crane-4amtkf", "--controller")

# name: arguments, what the one sentence must say
ONE_SENTENCE = {
    # the command line
    "unknown command": (["compre"], ['"compre"', "did you mean softstart compare?"]),
    "command unlike any": (
        ["zzzzzz"],
        [
            "there are init, plan, identify, wear, drives, reduce, compare, simulate, fatigue, controllers, "
            "linear, optimize, pareto, tune, sweep, serve, report, clutch, balance, study and completion"
        ],
    ),
    "unknown option": (["compare", "--jsno"], ["compare:", "'--jsno'", "Did you mean '--json'?"]),
    "unknown option before a command": (["--verion"], ["'--verion'", "Did you mean '--version'?"]),
    "unknown short option": (["compare", "-z"], ["No such option '-z'"]),
    "argument as an option": (["tune", "--drive", "crane-4amtkf"], ["tune:", "No such option '--drive'"]),
    "option without value": (["compare", "--set"], ["compare:", "'--set' requires an argument"]),
    "flag with value": (["compare", "--json=yes"], ["'--json' does not take a value"]),
    "too many arguments": (["compare", "good.toml", "good.toml"], ["compare:", "extra argument"]),
    "no drive": (["simulate", "--controller", "direct"], ["Missing argument 'DRIVE'"]),
    "no controller": (["simulate", "good.toml"], ["Missing option '--controller'"]),
    # the drive
    "missing file": (["compare", "nowhere.toml"], ['"nowhere.toml"', "no such file"]),
    "no drive and no chain": (["compare", "nosuch"], ["crane-4amtkf", "crane-4-mass", "tractor-like"]),
    "misspelt drive": (["compare", "crane-4amtk"], ["did you mean crane-4amtkf?"]),
    "folder as drive": (["compare", "folder"], ["directory"]),
    "not TOML": (["compare", "broken.toml"], ["line 1", "not valid TOML"]),
    "unknown key": (["compare", "misspelt.toml"], ["stifness", "did you mean stiffness?"]),
    "too weak": (["compare", "weak.toml"], ["starting_torque", "7.16"]),
    "several drives": (
        ["compare", "list.toml"],
        ["[shaft] gap = [0.5, 1.0]: a drive has one value", "use sweep"],
    ),
    "several drives by --set": ([*START, "direct", "--set", "gap=[1, 2]"], ["gap"]),
    # --set
    "setting twice": (["compare", "--set", "gap=1", "--set", "gap=2"], ["set before"]),
    "wrong unit": (["compare", "--set", "shaft.gap=2 m"], ["m is a length, not an angle"]),
    # --until
    "until 0": (["compare", "--until", "0"], ['--until = "0"', "above 0 s"]),
    "until NaN": (["compare", "--until", "nan"], ["not a number"]),
    "until a speed": (["compare", "--until", "5 rad/s"], ["not a time"]),
    # controllers by name
    "unknown controller": (["compare", "--controllers", "dirct"], ["--controllers", "did you mean direct?"]),
    "controller unlike any": ([*START, "zzzzzz"], ["--controller", "there are"]),
    "empty controller": (["compare", "--controllers", "direct,,ramp"], ['--controllers = ""', "there are"]),
    "controller twice": (["compare", "--controllers", "ramp,ramp"], ["named twice"]),
    # their parameters
    "parameter without value": ([*START, "ramp", "--param", "time"], ["--param", "equals sign"]),
    "unknown parameter": ([*START, "ramp", "--param", "tim=1"], ["--param tim = 1", "time"]),
    "parameter of wrong unit": ([*START, "ramp", "--param", "time=3 kg"], ["--param time", "not a time"]),
    "parameter NaN": ([*START, "direct", "--param", "torque=nan"], ["--param torque", "not a number"]),
    "parameter twice": ([*START, "ramp", "--param", "time=1", "--param", "time=2"], ["given twice"]),
    "parameter of no controller": (["compare", "--param", "time=1"], ["CONTROLLER.key=value"]),
    "parameter of another controller": (
        ["compare", "--controllers", "direct", "--param", "ramp.time=1"],
        ["ramp is not compared here"],
    ),
    "unknown parameter in a comparison": (
        ["compare", "--controllers", "direct,ramp", "--param", "ramp.tim=1"],
        ["--param ramp.tim = 1", "time"],
    ),
    # controllers in files
    "no such file": ([*START, "gone.py:Good"], ["gone.py: there is no such file"]),
    "folder as file": ([*START, "folder.py"], ["folder.py: there is no such file"]),
    "no such class": ([*START, "own.py:God"], ["no class God", "Good"]),
    "which class": ([*START, "own.py"], ["say which class"]),
    "file without classes": ([*START, "nothing.py"], ["say which class"]),
    "file that does not import": ([*START, "only.py:X"], ["does not run", "own_missing_module"]),
    "file with wrong syntax": ([*START, "syntax.py:X"], ["does not run", "SyntaxError"]),
    "file that quits": ([*START, "quits.py:X"], ["does not run", "SystemExit"]),
    "no controller class": ([*START, "own.py:NoController"], ["derive the class"]),
    "controller without step": ([*START, "own.py:Hollow"], ["step"]),
    "controller that answers text": ([*START, "own.py:Text"], ["answer with Command"]),
    # --out
    "output is a file": ([*START, "direct", "--out", "good.toml"], ["is a file, not a folder"]),
    "output below a file": ([*START, "direct", "--out", "good.toml/deeper"], ["is a file, not a folder"]),
    "unwritable output": ([*START, "direct", "--out", "/proc/softstart"], ["nothing can be written there"]),
    "empty output": ([*START, "direct", "--out", ""], ["name of the folder is empty"]),
    "impossible output": ([*START, "direct", "--out", "a\0b"], ["cannot be the path"]),
    "too long output": ([*START, "direct", "--out", "x" * 300], ["--out"]),
    # the rest
    "exposed without a token": (["serve", "--expose"], ["--host ADDRESS and --token TOKEN"]),
    "no folder of an identification": (
        ["wear", "NOFOLDER", "ALSO", "--dates", "2025-01-01,2026-01-01"],
        ["NOFOLDER/identification.json: there is no such file"],
    ),
    "unknown shipped drive": (["drives", "crane"], ["did you mean crane-4amtkf?"]),
    "unknown controller to describe": (["controllers", "rmp"], ["did you mean ramp?"]),
    "unknown study": (["study", "papr-g"], ['did you mean "paper-g"?']),
    "files of a list": (["study", "--out", "here"], ["a list writes no files"]),
}

# what every command that takes a drive says
OF_A_DRIVE = (
    "compare {}", "optimize {}", "pareto {}", "tune {} --controller ramp",
    "sweep {} --axis gap=1,2 --controller ramp", "linear {} --controller ramp", "fatigue {}",
)  # fmt: skip
for line in OF_A_DRIVE:
    name = line.split()[0]
    ONE_SENTENCE[f"{name}: misspelt"] = (line.format("crane-4amtk").split(), ["did you mean crane-4amtkf?"])
    ONE_SENTENCE[f"{name}: output"] = (line.format("--out good.toml").split(), ["is a file, not a folder"])
ONE_SENTENCE["pdf"] = (["report", "good.toml", "--pdf", "--json"], ["--pdf", "this is an option"])
ONE_SENTENCE["deep"] = (["compare", "deep.toml"], ["deep.toml: line 1", "keys are nested too deeply"])


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused(*arguments, says=says)


def test_what_is_wrong_in_a_file_is_told_at_once(refused):
    refused("compare", "wrong.toml", says=["starting_torque", "gap = nan"], mistakes=2)
    says = ["[motor]", "[clutch] inertia", "[clutch] torque", "[clutch] speed", "time tM"]
    refused("clutch", "good.toml", says=says, mistakes=5)


UNFINISHED = {
    "raises": ("own.py:Raises", ["own.py, line", "ZeroDivisionError"]),
    "leaves the program": ("own.py:Leaves", ["own.py, line", "SystemExit: 7"]),
    "answers NaN": ("own.py:Nan", ["NaN", "Nan"]),
    "wants to be asked in the past": ("own.py:Past", ["past instant"]),
}


@pytest.mark.parametrize("kind", UNFINISHED)
@pytest.mark.parametrize("output", [(), ("--json",), ("--out", "results")])
def test_a_start_that_cannot_be_finished(kind, output, run, nothing_left):
    controller, says = UNFINISHED[kind]
    code, out, err = run("simulate", "good.toml", "--controller", controller, *output)
    assert (code, out) == (3, "")
    assert err.startswith("softstart: The start was given up: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    for words in says:
        assert words in err
    nothing_left()


def test_a_failing_controller_fails_the_comparison(run, nothing_left):
    code, out, err = run("compare", "good.toml", "--controllers", "direct,own.py:Raises", "--out", "results")
    assert (code, out) == (3, "")
    assert "ZeroDivisionError" in err
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
