"""The Tab key: what a line may become, and that bash really does it."""

import os
import subprocess
import sys

import pytest
from click.shell_completion import ShellComplete

from softstart.cli.commands import cli

FILE, FOLDER = "a file", "a folder"
# the line up to the cursor: what must be offered, and what must not
LINES = {
    "softstart comp": (["compare", "completion"], ["study"]),
    "softstart compare ": (["crane-4amtkf"], ["direct"]),
    "softstart compare g": ([FILE], ["crane-4amtkf"]),
    "softstart compare --controllers direct,ra": (["direct,ramp"], ["direct,shaped", "ramp"]),
    "softstart sweep --axis load.k": (["load.kind="], ["controller="]),
    "softstart optimize --terminal s": (["synchronous", "steady"], ["reached"]),
    "softstart reduce --set mass[1].": (["mass[1].inertia="], ["shaft[1].gap="]),
    "softstart clutch --law ": (["linear", "exponential"], [FILE]),
    "softstart simulate good.toml --con": (["--controller"], ["--set"]),
    "softstart compare --out ": ([FOLDER], [FILE]),
}


@pytest.mark.parametrize("line", LINES)
def test_what_a_line_may_become(line, place):
    wanted, unwanted = LINES[line]
    *args, last = line.split(" ")[1:]
    found = ShellComplete(cli, {}, "softstart", "").get_completions(args, last)
    words = [{"file": FILE, "dir": FOLDER}.get(one.type, one.value) for one in found]
    assert [word for word in wanted if word not in words] == []
    assert [word for word in unwanted if word in words] == []
    assert all(one.value.startswith(last) for one in found)


def test_tab_in_bash(place, run, monkeypatch, refused):
    """`softstart` as a command that the shell finds: this Python with this library."""
    script = place / "bin" / "softstart"
    script.parent.mkdir()
    script.write_text(f"#!{sys.executable}\nimport sys\nfrom softstart.cli import main\nsys.exit(main())\n")
    script.chmod(0o755)
    path = f"{script.parent}{os.pathsep}{os.environ['PATH']}"
    asked = (
        'eval "$(softstart completion bash)"; COMP_WORDS=(softstart nothing x); COMP_CWORD=2; '
        "_softstart_completion softstart; COMP_WORDS=(softstart compare nord); "
        "_softstart_completion softstart; echo ${COMPREPLY[@]}"
    )
    ended = subprocess.run(
        ["bash", "-c", asked], env=os.environ | {"PATH": path}, capture_output=True, text=True, check=True
    )
    assert (ended.stdout, ended.stderr) == ("nordin-servo-60kw\n", "")
    monkeypatch.setenv("SHELL", "/usr/bin/zsh")
    assert "#compdef softstart" in run("completion").out
    monkeypatch.delenv("SHELL")
    refused("completion", says=["there are bash, zsh and fish"])
