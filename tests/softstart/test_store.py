"""The resumable store: what is finished stays, what was torn is done again, and nobody else writes."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from softstart.errors import InputError
from softstart.store import Records, Target

KEYS = ["cell", "restart"]
INPUTS = {"drive": "crane", "seed": 0, "metric": "k_dyn"}


def records(path, inputs=INPUTS):
    return Records(Target("save_to", path, "tuning"), inputs, KEYS)


def part(cell, restart=0, **known):
    return {"cell": cell, "restart": restart, **known}


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
        b"not json\n", b"[1]\n", b'{"cell": 1}\n', b'{"inputs": {}, "key": ""}\n{"a": 1}\n', b"\xff\xfe\n",
        b'{"inputs": {"drive": "crane", "seed": 0, "metric": "k_dyn"}, "key": "of others"}\n',
    ],
)  # fmt: skip
def test_a_file_that_holds_something_else_is_refused(tmp_path, content):
    path = tmp_path / "notes"
    path.write_bytes(content)
    with (
        pytest.raises(InputError, match="this file holds something else than a tuning; name another file"),
        records(path),
    ):
        pass
    assert path.read_bytes() == content


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
