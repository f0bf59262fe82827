"""The folder of --out."""

import os

import pytest

from softstart import InputError
from softstart.views.markdown import file_stem, output_folder, write_table, write_text


def fill(target, *names, fail=False):
    with output_folder(str(target)) as folder:
        for name in names:
            write_text(folder / name, name)
        if fail:
            raise RuntimeError


def test_nothing_asked_for():
    with output_folder(None) as folder:
        assert folder is None


def test_a_new_folder_appears_whole_with_the_usual_rights(tmp_path):
    target = tmp_path / "a" / "b"
    with output_folder(str(target)) as folder:
        write_text(folder / "x.txt", "x")
        assert not target.exists()
    (tmp_path / "usual").mkdir()
    assert target.stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert (target / "x.txt").read_text() == "x"
    assert sorted(os.listdir(tmp_path)) == ["a", "usual"]


@pytest.mark.parametrize("there", [True, False])
def test_a_failure_inside_leaves_nothing(tmp_path, there):
    target = tmp_path / "a" / "b"
    if there:
        target.mkdir(parents=True)
    with pytest.raises(RuntimeError):
        fill(target, "x.txt", fail=True)
    assert list(tmp_path.rglob("*.*")) == []
    assert (tmp_path / "a").exists() == there


def test_a_folder_where_a_file_is_to_go_is_found_before_anything_is_moved(tmp_path):
    (tmp_path / "x.txt").mkdir()
    with pytest.raises(InputError, match=r"x\.txt in it is a folder"):
        fill(tmp_path, "a.txt", "x.txt")
    assert os.listdir(tmp_path) == ["x.txt"]


def test_a_failure_while_putting_in_place_takes_back_new_parents(tmp_path, monkeypatch):
    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.rename", full)
    with pytest.raises(InputError, match="No space left"), output_folder(str(tmp_path / "a" / "b")):
        pass
    assert os.listdir(tmp_path) == []


def test_a_link_that_leads_nowhere(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(InputError, match="leads nowhere"), output_folder(str(tmp_path / "link")):
        pass


def test_a_folder_without_rights(tmp_path, monkeypatch):
    def refuse(**options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("softstart.store.tempfile.mkdtemp", refuse)
    with pytest.raises(InputError, match="Permission denied"), output_folder(str(tmp_path / "x")):
        pass


def test_names_that_no_file_may_have():
    assert file_stem("../../etc/passwd") == "-..-etc-passwd"
    assert file_stem("...") == "start"
    assert file_stem("a", ["a", "a-2"]) == "a-3"


def test_table(tmp_path):
    write_table(tmp_path / "t.csv", ["a", "b, c"], [[0.1, None], ["x", 2]])
    assert (tmp_path / "t.csv").read_text() == 'a,"b, c"\n0.1,\nx,2\n'
