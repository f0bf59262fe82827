"""The resumable store: what is finished stays, what was damaged is computed again, and nobody else writes."""

from __future__ import annotations

import errno
import os
import re
import socket
import sqlite3
import subprocess
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest

from softstart.errors import DamagedWarning, InputError
from softstart.input.files import write_whole
from softstart.stopping import AT_STOP
from softstart.store import PartStore, Target, fresh_folder
from softstart.views.markdown import output_folder

INPUTS = {"drive": "crane", "seed": 0, "metric": "k_dyn"}
PARTS = [{"cell": k, "restart": 0, "cost": 0.1 * k, "place": [1.0 / k, None]} for k in (1, 2, 3)]


def records(path, inputs=INPUTS):
    return PartStore(Target("save_to", path, "tuning"), inputs, ["cell", "restart"])


@pytest.fixture
def path(tmp_path):
    """A file with three parts."""
    path = tmp_path / "deep" / "parts.sqlite"
    with records(path) as kept:
        for one in PARTS:
            kept.add(one)
    return path


def found_in(path):
    with records(path) as kept:
        return [kept.find(k, 0) for k in (1, 2, 3, 4)]


def refused(path, sentence, **inputs):
    before = path.read_bytes() if path.is_file() else b""
    with (
        pytest.raises(InputError, match=f"save_to = .*{path.name}: .*{sentence}"),
        records(path, {**INPUTS, **inputs}),
    ):
        pass
    assert (path.read_bytes() if path.is_file() else b"") == before


def test_other_inputs_are_named_and_their_file_left_alone(path):
    others = {"drive": "x", "seed": 1, "more": 1}
    refused(path, "contains a tuning with another drive, seed and more; choose another file", **others)


@pytest.mark.parametrize("content", [b"x", b"\xff\xfe\n", b"letter" * 999, "database"])
def test_a_file_that_holds_something_else_is_refused(tmp_path, content):
    """SQLite takes a file of one byte for an empty one."""
    path = tmp_path / "notes"
    if content == "database":
        with closing(sqlite3.connect(path)) as base:
            base.execute("CREATE TABLE notes (text)")
    else:
        path.write_bytes(content)
    refused(path, "not a tuning file; choose another file")


def test_no_flipped_bit_comes_back_as_a_number(path):
    """Each bit of a byte somewhere: a part is right, or computed again, or the file is refused."""
    whole, copy = path.read_bytes(), path.with_name("copy")
    again = kept = 0
    for bit in range(0, 8 * len(whole), 211):
        torn = bytearray(whole)
        torn[bit // 8] ^= 1 << bit % 8
        copy.write_bytes(torn)
        with warnings.catch_warnings(record=True, action="always") as told:
            try:
                with records(copy) as store:
                    found = [store.find(one["cell"], 0) for one in PARTS]
                    for one in PARTS:
                        store.add(one)
            except InputError as error:
                assert re.search("not a|is damaged|readonly", str(error))  # noqa: PT017
                continue
        assert all(one in (None, true) for one, true in zip(found, PARTS, strict=True))
        if None in found:
            again += 1
            assert len(told) == 1
            assert "is damaged" in str(told[0].message)
            assert found_in(copy) == [*PARTS, None]
        kept += None not in found
    assert again > 2
    assert kept > 20


@pytest.mark.parametrize("size", [0, 100, 6000])
def test_a_file_that_was_cut_off_is_refused_or_begun_again(path, size):
    os.truncate(path, size)
    if size:
        refused(path, "is damaged|not a|cannot")
    else:
        assert found_in(path) == [None] * 4


def test_a_part_of_another_computation_is_no_part(path):
    other = path.with_name("other")
    with records(other, {**INPUTS, "seed": 1}) as kept:
        kept.add({**PARTS[0], "cost": 7.0})
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("ATTACH ? AS other", (str(other),))
        base.execute("REPLACE INTO parts SELECT * FROM other.parts WHERE key LIKE '[%'")
    with pytest.warns(DamagedWarning, match=r"part \[1, 0\] is damaged"):
        assert found_in(path) == [None, *PARTS[1:], None]


def test_a_damaged_part_is_told_once(path):
    """Also one under another key, which the part that is computed again does not replace."""
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("UPDATE parts SET key = '[9, 0]' WHERE key = '[1, 0]'")
    with pytest.warns(DamagedWarning, match=r"part \[9, 0\] is damaged"):
        assert found_in(path) == [None, *PARTS[1:], None]
    assert found_in(path) == [None, *PARTS[1:], None]


@pytest.mark.parametrize(
    ("count", "sentence"),
    [(1, "a is damaged"), (4, "a, b, c and d are damaged"), (5, "a, b, c and 2 more are damaged")],
)
def test_of_many_damaged_parts_some_are_named(tmp_path, count, sentence):
    with pytest.warns(DamagedWarning, match=f"kept: {sentence} "):
        Target("save_to", tmp_path / "kept", "tuning").warn_of_damage("abcde"[:count])


@pytest.mark.parametrize("stays", [True, False])
def test_a_file_without_parts_stays_only_if_others_belong_to_it(tmp_path, stays):
    with records(tmp_path / "parts") as kept:
        kept.stay(stays)
    assert (tmp_path / "parts").exists() == stays


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
def test_a_full_disk_is_one_sentence_and_costs_no_part(path, tmp_path):
    code = (
        "import resource, sys; from pathlib import Path; from softstart.store import PartStore, Target\n"
        "target = Target('save_to', Path(sys.argv[1]), 'tuning')\n"
        f"with PartStore(target, {INPUTS}, ['cell', 'restart']) as kept:\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "    for k in range(4, 999):\n"
        "        kept.add({'cell': k, 'restart': 0, 'text': 999 * 'x'})\n"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=False)
    assert "InputError: save_to = " in done.stderr.splitlines()[-1]
    assert "cannot be written" in done.stderr
    assert found_in(path)[:3] == PARTS


HOLDER = """
import sys
from pathlib import Path
from softstart.stopping import AT_STOP
from softstart.store import PartStore, Target, fresh_folder
path = Path(sys.argv[1])
with fresh_folder(path.parent), PartStore(Target("save_to", path, "tuning"), {}, ["cell"]) as kept:
    kept.add({"cell": 1})
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_signal_closes_no_file_that_is_being_written(tmp_path, monkeypatch):
    """SQLite crashes otherwise: the thread that waits for signals closes it, while another one writes."""
    begun, going_on = threading.Event(), threading.Event()
    path = tmp_path / "parts.sqlite"
    with records(path) as kept, ThreadPoolExecutor() as pool:
        seal = kept._seal

        def slow_seal(key, text):
            begun.set()
            assert going_on.wait(60.0)
            return seal(key, text)

        monkeypatch.setattr(kept, "_seal", slow_seal)
        writing = pool.submit(kept.add, PARTS[0])
        assert begun.wait(60.0)
        closing_it = pool.submit(AT_STOP[-1])
        with pytest.raises(TimeoutError):
            closing_it.result(0.1)
        going_on.set()
        writing.result(60.0)
        closing_it.result(60.0)
        monkeypatch.setattr("softstart.store.STOPPING", begun)
        with pytest.raises(KeyboardInterrupt):
            kept.add(PARTS[1])
        with pytest.raises(KeyboardInterrupt):  # it may have been closed as one to which nothing belongs
            kept.stay(True)
    assert found_in(path)[0] == PARTS[0]


def test_one_writer_at_a_time_and_a_dead_one_locks_nobody_out(tmp_path):
    path = tmp_path / "parts.sqlite"
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout.readline() == b"held\n"
    refused(path, "another process is writing this tuning; wait for it, or choose another file")
    (left,) = tmp_path.glob(".softstart-*.part")
    with fresh_folder(tmp_path):
        assert left.is_dir()
    holder.kill()
    holder.communicate()
    with PartStore(Target("save_to", path, "tuning"), {}, ["cell"]) as kept:
        assert kept.find(1) == {"cell": 1}
    with fresh_folder(tmp_path) as mine:
        assert {one.name for one in tmp_path.iterdir()} == {"parts.sqlite", mine.name}
    assert [one.name for one in tmp_path.iterdir()] == ["parts.sqlite"]


def test_a_file_is_locked_before_anything_is_added(path):
    again = pytest.raises(InputError, match="another process is writing this tuning")
    with records(path), again, records(path):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="there a folder is not removed by another process")
def test_folders_of_another_user_and_another_computer_stay(tmp_path, monkeypatch):
    with fresh_folder(tmp_path) as theirs:
        pass
    theirs.mkdir()
    elsewhere = tmp_path / ".softstart-elsewhere-1-0123abcd.part"
    elsewhere.mkdir()

    def forbidden(*_):
        raise PermissionError

    monkeypatch.setattr(os, "kill", forbidden)
    with fresh_folder(tmp_path):
        assert theirs.is_dir()
        assert elsewhere.is_dir()


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), ValueError("a bug")])
def test_a_file_that_could_not_be_written_is_as_before(tmp_path, error):
    (tmp_path / "file").write_text("old")

    def write(stream):
        stream.write("new")
        raise error

    with pytest.raises((InputError, ValueError), match=r"left on device; nothing was left behind\.|a bug"):
        write_whole(tmp_path / "file", write)
    assert [one.name for one in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "old"


@pytest.mark.parametrize("there", [True, False])
def test_what_a_killed_process_left_beside_a_folder_goes(tmp_path, there):
    """It wrote beside the folder, which was not there yet, or into it."""
    ended = subprocess.Popen([sys.executable, "-S", "-c", ""])
    ended.wait()
    out = tmp_path / "out"
    out.mkdir()
    left = (out if there else tmp_path) / f".softstart-{socket.gethostname()}-{ended.pid}-0123abcd.part"
    left.mkdir()
    with output_folder(str(out)):
        assert not left.exists()


def test_folders_made_at_once_are_not_taken_from_one_another(tmp_path):
    def work(number):
        for _ in range(20):
            with fresh_folder(tmp_path) as mine:
                (mine / "file").write_text(str(number))
                assert (mine / "file").read_text() == str(number)
        return number

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(4))) == [0, 1, 2, 3]
    assert list(tmp_path.iterdir()) == []
