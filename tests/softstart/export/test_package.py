"""The folder of an export: it appears whole, replaces what an export wrote, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from softstart import InputError
from softstart.export.package import MARK, check_prefix, prefix_of, write_files

FILES: dict[str, str | bytes] = {"README.md": MARK, "a.c": "int a;\n", "b.fmu": b"\0\1"}


def test_the_files_are_there(tmp_path: Path) -> None:
    write_files(tmp_path / "new" / "deep", FILES)
    assert (tmp_path / "new/deep/b.fmu").read_bytes() == b"\0\1"
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["deep"]


def test_an_export_is_replaced_whole(tmp_path: Path) -> None:
    write_files(tmp_path / "out", FILES)
    write_files(tmp_path / "out", {"README.md": MARK, "c.c": ""})
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["README.md", "c.c"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_files(tmp_path / "out", FILES)
    assert (tmp_path / "out/a.c").exists()


@pytest.mark.parametrize("name", ["mine.txt", "README.md"])
def test_a_folder_of_somebody_else_is_refused_and_kept(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match="has not written"):
        write_files(tmp_path, FILES)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    for place in ("out", "out/deeper"):
        with pytest.raises(InputError, match="folder"):
            write_files(tmp_path / place, FILES)


@pytest.mark.parametrize("prefix", ["a__b", "a_", "_a", "1a", "a-b", "ä", "a" * 33, "", "if", "Step", "STEP"])
def test_what_is_no_name_in_every_language_is_no_prefix(prefix: str) -> None:
    with pytest.raises(InputError, match="prefix"):
        check_prefix(prefix, frozenset({"if", "step"}))


@pytest.mark.parametrize("name", ["take-up", "4 wheels", "ü", "a__b", "x" * 50])
def test_each_name_has_a_prefix(name: str) -> None:
    assert check_prefix(prefix_of(name))
