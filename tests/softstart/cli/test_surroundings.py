"""What surrounds a command: files of the current folder, its streams, what the environment sets."""

from __future__ import annotations

import subprocess
import sys

import pytest

from softstart.cli import main

MATPLOTLIBRC = {
    "LaTeX": b"text.usetex: True",
    "a figure of any size": b"figure.dpi: 1e7\nsavefig.dpi: 1e7",
    "not a text": b"\xff\xfe\x00",
    "other code": b"backend: module://stranger",
}


def python(*words: str, **options):
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False, **options)


# ---- files of the current folder ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("first", ["softstart", "numba", "softstart_controllers.sampled"])
def test_a_file_in_the_folder_does_not_configure_numba(place, first):
    """Else its `cache_dir` makes numba load pickles from there, whoever wrote them."""
    (place / ".numba_config.yaml").write_text("cache_dir: stranger\ndisable_jit: 1\n")
    program = (
        f"import {first}, softstart; from softstart.kernel.jit import numba; numba.config.reload_config()\n"
        "config = numba.config; print(config.CACHE_DIR, config.DISABLE_JIT)"
    )
    ended = python("-c", program)
    assert (ended.stdout, ended.stderr) == (" 0\n", "")


@pytest.mark.slow
def test_a_broken_file_of_numba_does_not_stop_a_start(place, command):
    (place / ".numba_config.yaml").write_text("{broken: [")
    ended = python(*command[1:], *["simulate", "good.toml", "--controller", "direct", "--json"])
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("content", MATPLOTLIBRC.values(), ids=MATPLOTLIBRC)
def test_a_file_in_the_folder_does_not_configure_the_figures(place, command, content):
    (place / "matplotlibrc").write_bytes(content)
    (place / "stranger.py").write_text("raise SystemExit('code of a stranger')")
    ended = python(*command[1:], *["simulate", "good.toml", "--controller", "direct", "--out", "results"])
    assert (ended.returncode, ended.stderr) == (0, "")
    assert (place / "results" / "run-direct.png").stat().st_size > 10_000


def test_settings_of_the_user_do_not_change_the_figures(place):
    import matplotlib as mpl

    from softstart import simulate

    run = simulate("crane-4amtkf", "direct")
    for settings in (
        {},
        {"text.usetex": True, "axes.prop_cycle": mpl.cycler(color=["red"]), "font.size": 99},
    ):
        with mpl.rc_context(settings):
            figure = run.plot()
            assert mpl.rcParams["text.usetex"] == settings.get("text.usetex", False)
        line = figure.axes[0].lines[0]
        assert line.get_color() != "red"
        assert figure.axes[0].yaxis.label.get_size() < 20
        assert not any(text.get_usetex() for text in figure.findobj(type(figure.axes[0].title)))


def test_netcdf_without_its_library_is_refused_before_the_sweep(place, capsys, monkeypatch):
    """The library is an extra of the package."""
    from softstart.cli import main

    monkeypatch.setattr("softstart.cli.sweep.find_spec", lambda name: None)
    assert main(["sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5,2", "--netcdf", "grid.nc"]) == 2
    assert "--netcdf: h5netcdf is missing" in capsys.readouterr().err


def test_ipopt_reads_no_options_of_the_folder(place):
    """Among these is the name of a file that it writes."""
    import casadi

    from softstart.optimal.statement import OPTIONS

    (place / "ipopt.opt").write_text("output_file good.toml\n")
    before = (place / "good.toml").read_text()
    x = casadi.SX.sym("x")
    solver = casadi.nlpsol("least", "ipopt", {"x": x, "f": (x - 3.0) ** 2}, OPTIONS)
    assert float(solver(x0=0.0)["x"]) == pytest.approx(3.0)
    assert (place / "good.toml").read_text() == before


def test_run_as_a_module_it_takes_no_library_from_the_folder(place):
    (place / "click.py").write_text("raise SystemExit('code of a stranger')")
    ended = python("-m", "softstart", "--version")
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.slow
def test_a_kernel_that_may_not_be_compiled_is_one_sentence(place, command, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    ended = python(*command[1:], *["simulate", "good.toml", "--controller", "direct"])
    assert (ended.returncode, ended.stdout) == (2, "")
    says = "softstart simulates with compiled code alone; unset this variable."
    assert ended.stderr == f"softstart: NUMBA_DISABLE_JIT = 1: {says}\n"


# ---- closed streams ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("closed", "line", "code", "err"),
    [
        (">&-", "--version", 2, "softstart: the output could not be written: Bad file descriptor.\n"),
        (">&-", "drives nowhere", 2, None),
        ("2>&-", "--version", 0, ""),
        ("2>&-", "drives nowhere", 2, ""),
        ("<&-", "drives crane-4amtkf", 0, ""),
        ("<&- >&- 2>&-", "--version", 2, ""),
    ],
)
def test_a_closed_stream_is_no_bug(place, closed, line, code, err):
    """A message never goes to standard output instead, and no other file gets the number of a stream."""
    program = f"import sys; from softstart.cli import main; sys.argv[1:] = {line.split()}; sys.exit(main())"
    words = ["sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, program]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.returncode == code
    assert "bug" not in ended.stderr
    if err is not None:
        assert ended.stderr == err
    assert "softstart:" not in ended.stdout


# ---- what the class of a controller says of itself ---------------------------------------------------


@pytest.mark.parametrize(
    ("declared", "says"),
    [
        ("name: ClassVar = 5", "name = 5: declare it in the class as a text in quotes"),
        ("summary: ClassVar = None", "summary = None"),
        ("source: ClassVar = b'[G]'", "source = b'[G]'"),
        ("sensors: ClassVar = 3", "sensors = 3: declare it in the class as Sensor.STAGE"),
        ("effort: ClassVar = 'ramps'", "effort = 'ramps'"),
        ("needs: ClassVar = 'time'", "needs = 'time'"),
        ("saturates: ClassVar = 'no'", "saturates = 'no'"),
    ],
)
def test_what_a_class_says_of_itself_has_the_right_type(place, refused, declared, says):
    (place / "mine.py").write_text(
        "from typing import ClassVar\nfrom softstart import Command, PlainController\n\n"
        f"class Mine(PlainController):\n    {declared}\n"
        "    def step(self, measured, state):\n        return Command(31.0)\n"
    )
    for line in ("simulate good.toml --controller mine.py:Mine", "compare --controllers direct,mine.py:Mine"):
        refused(*line.split(), says=["Mine: " + says])
    assert main(["controllers", "mine.py:Mine"]) in (0, 2)
