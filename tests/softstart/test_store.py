"""The resumable store: what is finished stays, what was torn is done again, and nobody else writes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from softstart.errors import DamagedWarning, InputError
from softstart.store import Records, Target, fingerprint, fresh_folder, sealed

KEYS = ["cell", "restart"]
INPUTS = {"drive": "crane", "seed": 0, "metric": "k_dyn"}


def records(path, inputs=INPUTS):
    return Records(Target("save_to", path, "tuning"), inputs, KEYS)


def part(cell, restart=0, **known):
    return {"cell": cell, "restart": restart, **known}


def refused(path, sentence):
    with pytest.raises(InputError, match=sentence), records(path):
        pass


def test_parts_are_found_again(tmp_path):
    path = tmp_path / "deep" / "parts.jsonl"
    with records(path) as kept:
        kept.add(part(1, cost=0.1 + 0.2))
        kept.add(part(2, place=[1.0, None]))
        assert len(path.read_text().splitlines()) == 3
    with records(path) as again:
        assert again.find(1, 0) == part(1, cost=0.1 + 0.2)
        assert again.find(2, 0) == part(2, place=[1.0, None])
        assert again.find(3, 0) is None
    assert [one.name for one in path.parent.iterdir()] == ["parts.jsonl"]


@pytest.mark.parametrize("cut", [1, 9, 25])
def test_a_torn_last_line_costs_that_part_only(tmp_path, cut):
    path = tmp_path / "parts.jsonl"
    with records(path) as kept:
        kept.add(part(1))
        kept.add(part(2, note="to be torn"))
    whole = path.read_bytes()
    path.write_bytes(whole[: -1 - cut])
    with records(path) as again:
        assert again.find(1, 0)
        assert again.find(2, 0) is None
        again.add(part(2, note="to be torn"))
    assert path.read_bytes() == whole


def test_other_inputs_are_named_and_their_file_left_alone(tmp_path):
    path = tmp_path / "parts.jsonl"
    with records(path) as kept:
        kept.add(part(1))
    before = path.read_bytes()
    with (
        pytest.raises(
            InputError, match="holds a tuning with another drive, seed and more; name another file"
        ),
        records(path, {"drive": "hoist", "seed": 1, "metric": "k_dyn", "more": 1}),
    ):
        pass
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["parts.jsonl"]


@pytest.mark.parametrize(
    "content",
    [
        b"not json\n", b"[1]\n", b'{"cell": 1}\n', b"\xff\xfe\n", b"letter",
        sealed({"inputs": INPUTS, "key": "of others"}, "manifest").encode(),
    ],
)  # fmt: skip
def test_a_file_that_holds_something_else_is_refused(tmp_path, content):
    path = tmp_path / "notes"
    path.write_bytes(content)
    refused(path, "this file holds something else than a tuning; name another file")
    assert path.read_bytes() == content


def test_a_file_without_checksums_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "parts.jsonl"
    old = (
        json.dumps({"inputs": INPUTS, "key": fingerprint(INPUTS)})
        + "\n"
        + json.dumps(part(1, cost=2.0))
        + "\n"
    )
    path.write_text(old)
    refused(path, "or written by an older softstart; name another file")
    assert path.read_text() == old


def test_no_flipped_bit_comes_back_as_a_number(tmp_path):
    path = tmp_path / "parts.jsonl"
    parts = [part(k, cost=0.1 * k, place=[1.0 / k, None]) for k in (1, 2, 3)]
    with records(path) as kept:
        for one in parts:
            kept.add(one)
    whole = path.read_bytes()
    starts = [0, *(i + 1 for i, byte in enumerate(whole) if byte == 10)]
    for bit in range(0, 8 * len(whole), 7):  # each byte, and every bit of it somewhere
        torn = bytearray(whole)
        torn[bit // 8] ^= 1 << bit % 8
        path.write_bytes(torn)
        line = sum(start <= bit // 8 for start in starts)
        with warnings.catch_warnings(record=True, action="always") as told, records(path) as again:
            found = [again.find(one["cell"], 0) for one in parts]
            assert all(one in (None, true) for one, true in zip(found, parts, strict=True))
            lost = sum(one is None for one in found)
            assert lost <= (2 if torn.count(10) < 4 else 1)  # without its end a line takes the next one along
            for one in parts:
                again.add(one)
        if bit // 8 < len(whole) - 1:  # else the last line only lacks its end, as after a kill
            assert len(told) == 1
            assert f"line {line}" in str(told[0].message) or torn.count(10) > 4
    path.write_bytes(b"".join(whole.splitlines(keepends=True)[k] for k in (0, 3, 2, 1)))
    with records(path) as again:
        assert [again.find(one["cell"], 0) for one in parts] == parts


def test_a_part_of_another_computation_is_no_part(tmp_path):
    path, other = tmp_path / "parts.jsonl", tmp_path / "other.jsonl"
    for place, inputs in ((path, INPUTS), (other, {**INPUTS, "seed": 1})):
        with records(place, inputs) as kept:
            kept.add(part(1, cost=inputs["seed"]))
    path.write_bytes(
        path.read_bytes().splitlines(keepends=True)[0] + other.read_bytes().splitlines()[1] + b"\n"
    )
    with pytest.warns(DamagedWarning, match=r"line 2 is damaged"), records(path) as again:
        assert again.find(1, 0) is None


@pytest.mark.parametrize("what", ["folder", "pipe", "link"])
def test_something_else_in_the_place_of_file_or_lock(tmp_path, what):
    make = {
        "folder": Path.mkdir,
        "pipe": os.mkfifo,
        "link": lambda place: place.symlink_to(tmp_path / "precious"),
    }
    (tmp_path / "precious").write_text("dear")
    make[what](tmp_path / "parts.jsonl")
    make[what](tmp_path / ".more.jsonl.lock")
    for name in ("parts.jsonl", "more.jsonl"):
        with (
            pytest.raises(InputError, match=f"save_to = .*{name}: .* (another file|a file in a folder)"),
            records(tmp_path / name),
        ):
            pass
    assert (tmp_path / "precious").read_text() == "dear"


def test_what_a_killed_owner_left_is_removed_and_a_living_one_keeps_his(tmp_path):
    for name in (".softstart-dead.part", ".parts.jsonl.dead.part"):
        (tmp_path / name).mkdir() if "softstart" in name else (tmp_path / name).write_text("")
    (tmp_path / ".softstart-dead.part" / "half").write_text("")
    with fresh_folder(tmp_path) as mine:
        assert [one.name for one in tmp_path.iterdir() if one.is_dir()] == [mine.name]
        with fresh_folder(tmp_path) as other:
            assert mine.is_dir()
            assert mine != other
    with records(tmp_path / "parts.jsonl"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_owner_killed_before_its_first_file_leaves_nothing_to_the_next(tmp_path):
    (tmp_path / ".softstart-empty.part").mkdir()
    with fresh_folder(tmp_path) as mine:
        assert list(tmp_path.iterdir()) == [mine]
    assert list(tmp_path.iterdir()) == []


def test_folders_made_and_swept_at_once_are_not_taken_from_one_another(tmp_path):
    """A folder that another thread sweeps away before it is locked is made again."""

    def work(number):
        for _ in range(60):
            with fresh_folder(tmp_path) as mine:
                (mine / "file").write_text(str(number))
                assert (mine / "file").read_text() == str(number)
        return number

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(4))) == [0, 1, 2, 3]
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_place_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(InputError, match=r"nothing can be written there .*; give a file in a folder"),
        records(tmp_path / "file" / "x.jsonl"),
    ):
        pass


def test_a_run_that_keeps_nothing_leaves_no_folder(tmp_path):
    with records(tmp_path / "a" / "b" / "parts.jsonl"):
        pass
    assert list(tmp_path.iterdir()) == []


HOLDER = """
import sys
from pathlib import Path
from softstart.store import Records, Target
with Records(Target("save_to", Path(sys.argv[1]), "tuning"), {}, ["cell"]) as kept:
    kept.add({"cell": 1})
    print("held", flush=True)
    sys.stdin.read()
"""


def test_one_writer_at_a_time_and_a_dead_one_locks_nobody_out(tmp_path):
    path = tmp_path / "parts.jsonl"
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout.readline() == b"held\n"
    with (
        pytest.raises(InputError, match=rf"process {holder.pid} on .* is writing this tuning now"),
        Records(Target("save_to", path, "tuning"), {}, ["cell"]),
    ):
        pass
    holder.kill()
    holder.communicate()
    with Records(Target("save_to", path, "tuning"), {}, ["cell"]) as kept:
        assert kept.find(1) == {"cell": 1}
    assert [one.name for one in tmp_path.iterdir()] == ["parts.jsonl"]
    assert json.loads(path.read_text().splitlines()[0])["inputs"] == {}
