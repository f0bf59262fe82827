"""The Tab key: what a line may become, and that bash, zsh and fish really do it."""

import os
import pty
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from softstart.cli.commands import cli
from softstart.cli.completion import SHELLS, drive_keys
from softstart.drive import PARAMETERS, Drive
from softstart.plugins import registered

TWO_CLASSES = (
    "class One:\n    pass\n\nclass Two(One):\n    pass\n\nraise SystemExit('nobody is to run this')\n"
)

# the line up to the cursor: what must be offered, and what must not
LINES = {
    "softstart ": (["compare", "study", "completion"], ["ramp"]),
    "softstart comp": (["compare", "completion"], ["study"]),
    "LANG=C softstart comp": (["compare", "completion"], ["study"]),
    "softstart compare ": (["crane-4amtkf", "good.toml", "folder/"], ["own.py", "direct"]),
    "softstart compare g": (["good.toml"], ["crane-4amtkf"]),
    "softstart compare folder/": (["folder/deep.toml"], ["good.toml"]),
    "softstart compare --controllers ": (["direct", "ramp", "two.py:", "good.toml"], ["crane-4amtkf"]),
    "softstart compare --controllers direct,": (["direct,ramp"], ["direct,direct", "ramp"]),
    "softstart compare --controllers direct,ra": (["direct,ramp"], ["direct,shaped"]),
    "softstart compare --controllers=direct,ra": (["--controllers=direct,ramp"], ["direct,ramp"]),
    "softstart simulate good.toml --controller two.py:T": (["two.py:Two"], ["two.py:One"]),
    "softstart simulate good.toml --controller gone.py:": ([], ["gone.py:One"]),
    "softstart compare --set shaft.g": (["shaft.gap="], ["load.inertia="]),
    "softstart compare --set load.kind=": (["load.kind=active", "load.kind=reactive"], []),
    "softstart compare --set load.inertia=": ([], ["load.inertia="]),
    "softstart compare --set nothing=": ([], ["nothing="]),
    "softstart simulate good.toml --controller ramp --param ti": (["time="], ["torque="]),
    "softstart simulate good.toml --controller two.py:One --param ": ([], ["time="]),
    "softstart compare --controllers ramp --param ": (["ramp."], ["direct."]),
    "softstart compare --param ramp.ti": (["ramp.time="], ["time="]),
    "softstart sweep --axis load.k": (["load.kind="], ["controller="]),
    "softstart sweep --axis controller=direct,ra": (["controller=direct,ramp"], []),
    "softstart optimize --terminal s": (["synchronous", "steady"], ["reached"]),
    "softstart reduce --set mass[1].": (["mass[1].inertia="], ["shaft[1].gap="]),
    "softstart clutch --law ": (["linear", "exponential"], ["good.toml"]),
    "softstart balance v": (["vaz-11113"], []),
    "softstart study paper-": (["paper-g", "paper-r"], ["wear"]),
    "softstart drives crane-4amtkf-w": (["crane-4amtkf-worn"], []),
    "softstart controllers s-": (["s-curve"], ["shaped"]),
    "softstart simulate good.toml --con": (["--controller"], ["--set"]),
    "softstart compare --out ": (["folder/"], ["good.toml"]),
    "softstart nothing ": ([], ["compare"]),
}


@pytest.fixture
def folder(place):
    (place / "two.py").write_text(TWO_CLASSES)
    (place / "folder" / "deep.toml").touch()
    (place / "my drive.toml").touch()
    return place


@pytest.mark.parametrize("line", LINES)
def test_what_a_line_may_become(line, folder, monkeypatch):
    monkeypatch.setenv("COMP_LINE", line)
    offered = SHELLS["fish"](cli, {}, "softstart", "").complete().splitlines()
    words = [one.partition("\t")[0] for one in offered]
    wanted, unwanted = LINES[line]
    assert [word for word in wanted if word not in words] == []
    assert [word for word in unwanted if word in words] == []
    last = line.rpartition(" ")[2]
    assert all(word.startswith(last) for word in words)


def test_every_key_that_is_offered_can_be_set():
    keys = drive_keys()
    drive = Drive.load("crane-4amtkf")
    for parameter in PARAMETERS.values():
        value = parameter.example.strip('"')
        needed = {
            "required_life": ("starts_per_hour",),
            "fatigue_torque": ("fatigue_slope", "fatigue_cycles"),
            "fatigue_cycles": ("fatigue_slope", "fatigue_torque"),
        }.get(parameter.name, ())
        also = [f"{PARAMETERS[name].path}={PARAMETERS[name].example}" for name in needed]
        changed = drive.with_settings([f"{parameter.path}={value}", *also])
        assert changed.name == (value if parameter.name == "name" else drive.name)
        assert parameter.unit in ("", "1") or keys[parameter.path][0].endswith(parameter.unit)
    assert keys["load.kind"][1] == ("active", "reactive")


def test_words_are_written_as_each_shell_reads_them(folder, monkeypatch):
    monkeypatch.setenv("COMP_LINE", "softstart compare my")
    told = {name: made(cli, {}, "softstart", "").complete() for name, made in SHELLS.items()}
    assert told == {"bash": "my\\ drive.toml", "zsh": "my drive.toml", "fish": "my drive.toml"}
    monkeypatch.setenv("COMP_LINE", "softstart simulate x --controller two.py:O")
    assert SHELLS["zsh"](cli, {}, "softstart", "").complete() == r"two.py\:One"


def test_no_shell_and_a_wrong_one(run, monkeypatch):
    monkeypatch.setenv("SHELL", "/usr/bin/zsh")
    assert run("completion").out.startswith("#compdef softstart")
    monkeypatch.delenv("SHELL")
    code, out, err = run("completion")
    assert (code, out) == (2, "")
    assert "there are bash, zsh and fish" in err
    assert 'shell = "fsh"' in run("completion", "fsh").err


@pytest.fixture
def on_path(folder):
    """`softstart` as a command that a shell finds: this Python with this library."""
    script = folder / "bin" / "softstart"
    script.parent.mkdir()
    script.write_text(f"#!{sys.executable}\nimport sys\nfrom softstart.cli import main\nsys.exit(main())\n")
    script.chmod(0o755)
    return os.environ | {
        "PATH": f"{script.parent}{os.pathsep}{os.environ['PATH']}", "TERM": "dumb", "HOME": str(folder),
    }  # fmt: skip


def typed(shell: list[str], environment: dict[str, str], before: str, keys: str, until: str) -> str:
    """What an interactive shell shows after the keys; given up after a minute."""
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        shell, stdin=follower, stdout=follower, stderr=follower, env=environment, start_new_session=True
    )
    os.close(follower)
    shown, end = "", time.monotonic() + 60.0

    def wait_for(words: str) -> None:
        nonlocal shown
        while words not in shown and time.monotonic() < end:
            if select.select([leader], [], [], 0.1)[0]:
                shown += os.read(leader, 4096).decode(errors="replace")

    try:
        os.write(leader, f"{before}; echo rea''dy\n".encode())
        wait_for("ready")
        os.write(leader, keys.encode())
        wait_for(until)
        return shown
    finally:
        process.kill()
        process.wait()
        os.close(leader)


@pytest.mark.parametrize(
    ("shell", "before"),
    [
        (["bash", "--norc", "-i"], 'eval "$(softstart completion bash)"'),
        (["zsh", "-f", "-i"], 'autoload -U compinit; compinit -u -D; eval "$(softstart completion zsh)"'),
    ],
    ids=["bash", "zsh"],
)
def test_tab_in_an_interactive_shell(shell, before, on_path):
    if shutil.which(shell[0]) is None:
        pytest.skip(f"needs {shell[0]}")
    keys = "softstart compare g\t--controllers=direct,ra\t--set load.ki\trea\t"
    wanted = "compare good.toml --controllers=direct,ramp --set load.kind=reactive\r\n"
    to_echo_it = "\x01echo \n"  # to the beginning of the line, and Enter
    assert wanted in typed(shell, on_path, before, keys + to_echo_it, wanted)


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
def test_completion_in_fish(on_path):
    asked = 'softstart completion fish | source; complete -C "softstart compare --controllers direct,ra"'
    ended = subprocess.run(["fish", "-c", asked], env=on_path, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["direct,ramp"]


def test_every_registered_name_is_offered(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for line, group in (("tune --controller ", "softstart.controllers"), ("study ", "softstart.studies")):
        monkeypatch.setenv("COMP_LINE", f"softstart {line}")
        assert SHELLS["bash"](cli, {}, "softstart", "").complete().splitlines() == list(registered(group))


def test_an_unreadable_folder_is_no_failure(monkeypatch, tmp_path):
    monkeypatch.setenv("COMP_LINE", f"softstart compare {tmp_path}/gone/x")
    assert SHELLS["bash"](cli, {}, "softstart", "").complete() == ""
    assert not list(Path(tmp_path).iterdir())
