"""Damaged stores: results on disk give the right numbers or a sentence, whatever happens to them.

A small sweep, tuning and limit curve are computed once; a copy is damaged (bits flipped, files cut, emptied,
lengthened, deleted, exchanged, replaced by a folder, a pipe or a link), and the same call made twice. The
numbers must be those of the undamaged store, to the bit, or the store refused in a sentence; after the first
call nothing is damaged any more. `--size 10`: ten times as many damages.
"""

from __future__ import annotations

import os
import random
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softstart import Drive, InputError, pareto, sweep, tune
from softstart.errors import DamagedWarning

pytestmark = pytest.mark.slow
CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
CHUNK = 4  # starts
GRID = {
    "gap": np.linspace(0.25, 4.0, 6),
    "load_inertia": np.linspace(0.07, 0.35, 4),
    "controller": ["ramp", "direct"],
}


def swept(place: Path) -> tuple[str, int]:
    """The numbers of the sweep in `place`, and how many starts were computed for it."""
    told: list[Any] = []
    found = sweep(CRANE, None, GRID, to=place / "a.zarr", chunk=CHUNK, workers=1, progress=told.append)
    numbers = {str(name): found[name].values.tolist() for name in (*found.data_vars, *found.coords)}
    return repr(numbers), told[-1].done - told[0].before


def tuned(place: Path) -> tuple[str, int]:
    """The tuning likewise."""
    options = {"generations": 3, "population": 8, "restarts": 3, "workers": 1, "certified": False}
    found = tune(
        CRANE, "reduced-first-stage", ["1x"], ["1x", "2x"], free=["torque"], save_to=place / "a.sqlite",
        **options,
    )  # fmt: skip
    return repr({**found.summary(), "seconds": 0, "starts": 0}), 0


def limited(place: Path) -> tuple[str, int]:
    """The limit curve likewise."""
    times = [0.2, 0.2883042, 0.31, 0.33]
    found = pareto(CRANE, times, terminal="synchronous", controllers=["direct"], save_to=place / "a.sqlite")
    points = [{**point.summary(), "seconds": 0} for point in found.points]
    return repr((points, [one.summary() for one in found.controllers])), 0


def changed(file: Path, chance: random.Random) -> None:
    """A flipped bit, a block of zeros as after a power failure, a cut, more at the end, or no rights."""
    content = bytearray(file.read_bytes())
    at = chance.randrange(len(content) or 1)
    kind = chance.choice(["flip", "flip", "flip", "blank", "cut", "longer", "rights"])
    if kind == "rights":
        return file.chmod(0)  # which root has nevertheless
    if kind == "flip" and content:
        content[at] ^= 1 << chance.randrange(8)
    elif kind == "blank":
        content[at : at + 300] = bytes(len(content[at : at + 300]))
    elif kind == "cut":
        del content[at:]
    else:
        content += chance.randbytes(chance.randrange(1, 40))
    file.write_bytes(content)
    return None


def exchanged(file: Path, chance: random.Random) -> None:
    """With another file of the store."""
    store = next(one for one in file.parents if one.name == "store")
    other = chance.choice(sorted(one for one in store.rglob("*") if one.is_file()))
    content = file.read_bytes()
    file.write_bytes(other.read_bytes())
    other.write_bytes(content)


def replaced(file: Path, chance: random.Random) -> None:
    """By something that is no file, or by nothing; its whole folder, too."""
    kind = chance.choice(["folder", "pipe", "nowhere", file.name, "none", "none", "all"])
    if kind == "all" and file.parent.name != "store":
        shutil.rmtree(file.parent)
        return
    file.unlink()
    if kind == "folder":
        file.mkdir()
    elif kind == "pipe":
        os.mkfifo(file)
    elif kind in ("nowhere", file.name):
        file.symlink_to(kind)


@pytest.mark.parametrize("work", [swept, tuned, limited])
def test_damages_give_the_same_numbers_or_a_sentence(
    tmp_path: Path, work: Callable[[Path], tuple[str, int]], pytestconfig: pytest.Config
) -> None:
    chance = random.Random(work.__name__)
    store, pristine = tmp_path / "store", tmp_path / "pristine"
    store.mkdir()
    true, _ = work(store)
    store.rename(pristine)
    for number in range((16 if work is swept else 4) * pytestconfig.getoption("size")):
        shutil.rmtree(store, ignore_errors=True)
        shutil.copytree(pristine, store)
        file = chance.choice(sorted(one for one in store.rglob("*") if one.is_file()))
        damage = chance.choice([changed, changed, exchanged, replaced])
        damage(file, chance)
        what = f"{number}: {file.relative_to(store)} {damage.__name__}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DamagedWarning)
            try:
                numbers, computed = work(store)
            except InputError as error:
                refused = error.sentences[0]
                numbers, computed = "", 0
        if not numbers:
            assert refused.startswith(("to = ", "save_to = ")), what
            continue
        assert numbers == true, what
        assert computed <= 2 * CHUNK or damage is replaced, what
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # nothing is damaged any more
            assert work(store) == (true, 0), what
        left = [one for one in store.rglob("*") if one.name.endswith((".part", ".partial", "-journal"))]
        assert not left, what
