"""A sweep on disk: killed at any instant it goes on, nothing is lost or repeated, and nobody else writes."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray

from softstart import Drive, InputError, sweep
from softstart.errors import DamagedWarning

from .conftest import alive, children

CRANE = Drive.load("crane-4amtkf")
GRID = {"gap": [0.5, 1.0, 2.0], "load_inertia": [0.1, 0.2]}
OPTIONS = {"workers": 1, "chunk": 2}


@pytest.mark.slow
def test_killed_at_random_instants_it_goes_on(sweeping, uninterrupted, tmp_path):
    folder = tmp_path / "results"
    instants = random.Random(7)
    before: dict[str, int] = {}
    for workers, processes in ((1, 0), (2, 0), (2, 2)):
        process = sweeping.begin(folder, workers, bool(processes))
        sweeping.wait_for(folder, len(before) + instants.randint(2, 12), process)
        time.sleep(instants.uniform(0.0, 0.08))
        helpers = children(process.pid)
        assert len(helpers) == processes
        process.send_signal(signal.SIGKILL)
        process.communicate()
        deadline = time.monotonic() + 300
        while any(map(alive, helpers)):  # they end by themselves
            assert time.monotonic() < deadline
            time.sleep(0.01)
        after = sweeping.finished(folder)
        assert len(after) < sweeping.chunks
        assert before.items() <= after.items()  # nothing was lost, nothing written again
        before = after
    told = []
    found = sweep(
        "crane-4amtkf", "current-limit-feedback", sweeping.grid, to=folder, workers=1, chunk=sweeping.chunk,
        progress=told.append,
    )  # fmt: skip
    assert told[0].done == told[0].before >= sweeping.chunk * len(before)
    assert [now.done for now in told[1:]] == sorted({now.done for now in told[1:]})
    assert told[-1].done == told[-1].starts == 12_000
    assert before.items() <= sweeping.finished(folder).items()
    assert found.drop_attrs().identical(uninterrupted.drop_attrs())
    assert not list(folder.rglob("*.partial"))
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_it_is_a_zarr_folder_that_says_what_is_missing(tmp_path):
    def stop(now):
        if now.done:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        sweep(CRANE, "ramp", GRID, to=tmp_path / "a", progress=stop, **OPTIONS)
    begun = xarray.open_zarr(tmp_path / "a")
    assert begun.status.values.tolist() == [[0, 0], [-1, -1], [-1, -1]]
    assert np.isnan(begun.k_dyn.values[1:]).all()
    assert begun.k_dyn.chunks == ((1, 1, 1), (2,))
    whole = sweep(CRANE, "ramp", GRID, to=tmp_path / "a", **OPTIONS)
    assert whole.drop_attrs().identical(sweep(CRANE, "ramp", GRID, **OPTIONS).drop_attrs())


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """A finished sweep of three chunks, which no test changes."""
    folder = tmp_path_factory.mktemp("sweeps") / "a"
    sweep(CRANE, "ramp", GRID, to=folder, **OPTIONS)
    return folder


def test_a_finished_sweep_is_opened_and_not_computed_again(pristine):
    first, told = xarray.open_zarr(pristine, chunks=None), []
    before = {path: path.stat().st_mtime_ns for path in pristine.rglob("*")}
    again = sweep(CRANE, "ramp", GRID, to=str(pristine), progress=told.append, chunk=2)
    assert again.identical(first)
    assert {path: path.stat().st_mtime_ns for path in pristine.rglob("*")} == before
    assert [(now.done, now.before) for now in told] == [(6, 6)]


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


def swap(path):
    other = path.parent.parent / "1" / "0"
    content, others = path.read_bytes(), other.read_bytes()
    path.write_bytes(others)
    other.write_bytes(content)


def replaced(make):
    """By something that is no ordinary file."""
    return lambda path: (path.unlink(), make(path))


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("k_dyn/c/0/0", flip),
        ("k_dyn/c/0/0", swap),
        ("k_dyn/c/0/0", lambda path: os.truncate(path, 9)),
        ("k_dyn/c/0/0", lambda path: path.write_bytes(path.read_bytes() + b"more")),
        ("k_dyn/c/0/0", lambda path: shutil.rmtree(path.parent)),
        ("status/c/0/0", Path.unlink),
        ("status/c/0/0", replaced(os.mkfifo)),
        ("status/c/0/0", replaced(os.mkdir)),
        ("k_dyn/c/0", lambda path: (shutil.rmtree(path), path.write_text("a file"))),
        ("status/c/0/0", replaced(lambda path: path.symlink_to(path.name))),
    ],
)
def test_a_damaged_chunk_is_named_and_alone_computed_again(pristine, tmp_path, name, damage):
    folder = Path(shutil.copytree(pristine, tmp_path / "a"))
    damage(folder / name)
    lost = 2 if damage is swap else 1
    told = []
    with warnings.catch_warnings(record=True, action="always") as sentences:
        again = sweep(CRANE, "ramp", GRID, to=folder, progress=told.append, **OPTIONS)
    assert (told[0].before, told[-1].done) == (6 - 2 * lost, 6)
    assert again.identical(xarray.open_zarr(pristine, chunks=None))
    assert len(sentences) == 1
    assert sentences[0].category is DamagedWarning
    assert name in str(sentences[0].message)
    told.clear()
    sweep(CRANE, "ramp", GRID, to=folder, progress=told.append, **OPTIONS)
    assert [now.before for now in told] == [6]
    assert {p.relative_to(folder) for p in folder.rglob("*")} == {
        p.relative_to(pristine) for p in pristine.rglob("*")
    }


@pytest.mark.parametrize("name", ["k_dyn/c/0/0", "status/c/1/0", "k_dyn/zarr.json"])
def test_a_full_folder_in_the_place_of_a_file_is_refused_before_anything_is_said_or_changed(
    pristine, tmp_path, name
):
    folder = Path(shutil.copytree(pristine, tmp_path / "a"))
    replaced(os.mkdir)(folder / name)
    (folder / name / "letter.txt").write_text("dear")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=f"{name} in it is a folder, .* move it away"):
        sweep(CRANE, "ramp", GRID, to=folder, **OPTIONS)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    shutil.move(folder / name, tmp_path / "moved")
    with pytest.warns(DamagedWarning, match=f"{name} is damaged"):
        again = sweep(CRANE, "ramp", GRID, to=folder, **OPTIONS)
    assert again.identical(xarray.open_zarr(pristine, chunks=None))


@pytest.mark.parametrize("made", [(), ("a",)])
def test_one_that_ends_before_its_first_chunk_leaves_nothing(tmp_path, made):
    """Then another sweep may use the folder; what was there before it stays."""
    for name in made:
        (tmp_path / name).mkdir()

    def fail(now):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        sweep(CRANE, "ramp", GRID, to=tmp_path / "a", progress=fail, **OPTIONS)
    assert [path.name for path in tmp_path.rglob("*")] == list(made)
    found = sweep(CRANE, "direct", {"gap": [0.5, 2.0]}, to=tmp_path / "a", workers=1)
    assert found.status.values.tolist() == [0, 0]


KILLED = """
import os, signal, sys
from softstart import sweep
from softstart.stopping import stop_now
from softstart.sweeping import store

begin = store.FolderStore._open
def opened(self, folder):
    begin(self, folder)
    {how}
store.FolderStore._open = opened
sweep("crane-4amtkf", "ramp", {grid}, to={to!r}, workers=1, chunk=2)
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", ["stop_now(130)", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_stopped_before_its_first_chunk_it_goes_on(tmp_path, how):
    to = str(tmp_path / "a")
    program = KILLED.format(how=how, grid=GRID, to=to)
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode in (130, -signal.SIGKILL)
    assert xarray.open_zarr(to).status.values.tolist() == [[-1, -1]] * 3
    with pytest.raises(InputError, match="another controller"):
        sweep(CRANE, "direct", GRID, to=to, **OPTIONS)
    found = sweep(CRANE, "ramp", GRID, to=to, **OPTIONS)
    assert found.drop_attrs().identical(sweep(CRANE, "ramp", GRID, **OPTIONS).drop_attrs())


@pytest.mark.parametrize("name", ["zarr.json", "k_dyn/zarr.json", "gap/c/0"])
@pytest.mark.parametrize("damage", ["flip", "folder"])
def test_damaged_descriptions_are_mended(pristine, tmp_path, name, damage):
    folder = Path(shutil.copytree(pristine, tmp_path / "a"))
    (flip if damage == "flip" else replaced(os.mkdir))(folder / name)
    told = []
    with pytest.warns(DamagedWarning, match=f"{name} is damaged"):
        sweep(CRANE, "ramp", GRID, to=folder, progress=told.append, **OPTIONS)
    assert [now.before for now in told] == [6]
    files = [path.relative_to(pristine) for path in pristine.rglob("*") if path.is_file()]
    assert [(folder / file).read_bytes() for file in files] == [
        (pristine / file).read_bytes() for file in files
    ]


def test_what_is_no_sweep_is_refused_and_not_removed(pristine, tmp_path):
    folder = Path(shutil.copytree(pristine, tmp_path / "a"))
    (folder / "status" / "softstart.sqlite").unlink()
    full, file = tmp_path / "full", tmp_path / "file"
    full.mkdir()
    for path in (file, full / "letter.txt"):
        path.write_text("dear")
    for place in (folder, full, file, file / "below"):
        with pytest.raises(InputError, match="to = "):
            sweep(CRANE, "ramp", GRID, to=place, **OPTIONS)
    assert file.read_text() == (full / "letter.txt").read_text() == "dear"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"drive": CRANE.replace(damping=1.0)}, "another drive;"),
        ({"parameters": {"time": 0.2}}, "another controller;"),
        ({"grid": {**GRID, "gap": [0.5, 1.0, 2.5]}}, "another axis gap;"),
        ({"grid": {**GRID, "stiffness": [300.0]}}, "another order of the axes and axis stiffness;"),
        ({"figures": ["k_dyn"], "fitted_to": CRANE}, "another figures and fitted_to;"),
    ],
)  # fmt: skip
def test_another_sweep_is_refused_and_left_alone(pristine, change, says):
    before = {path: path.read_bytes() for path in pristine.rglob("*") if path.is_file()}
    with pytest.raises(InputError) as caught:
        sweep(**{"drive": CRANE, "controller": "ramp", "grid": GRID, "to": pristine, **OPTIONS, **change})
    assert len(caught.value.sentences) == 1
    assert says in caught.value.sentences[0]
    assert {path: path.read_bytes() for path in pristine.rglob("*") if path.is_file()} == before


def test_a_controller_from_a_file_that_changed_is_another_one(tmp_path):
    lines = (
        "from softstart import Command, PlainController\n"
        "class Half(PlainController):\n"
        "    def step(self, measured, state):\n"
        "        return Command(31.0 if measured.time < 0.1 else 62.0, measured.time + 0.01)\n"
    )
    (tmp_path / "mine.py").write_text(lines)
    name = f"{tmp_path / 'mine.py'}:Half"
    found = sweep(CRANE, name, {"gap": [0.5, 2.0]}, to=tmp_path / "a", workers=1)
    assert found.status.values.tolist() == [0, 0]
    (tmp_path / "mine.py").write_text(lines.replace("31.0", "32.0"))
    with pytest.raises(InputError, match="another controller"):
        sweep(CRANE, name, {"gap": [0.5, 2.0]}, to=tmp_path / "a")
