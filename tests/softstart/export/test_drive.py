"""Machines as FMU: what the folder holds."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from softstart import Drive, InputError
from softstart.export.drive import MOST, export_drive, vectors

CRANE = Drive.load("crane-4amtkf")


def test_the_folder_holds_both_versions_vectors_and_what_to_know(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    folder = tmp_path / "out"
    export = export_drive(CRANE.replace(gap=0.6), folder, prefix="crane", origin="softstart export --as fmu")
    assert {path.name for path in folder.iterdir()} == set(export.files)
    assert sorted(export.files) == ["README.md", "crane_fmi2.fmu", "crane_fmi3.fmu", "vectors.csv"]
    assert export.summary()["folder"] == str(folder)
    assert not export.notes or "sources only" in export.notes[0]
    readme = (folder / "README.md").read_text()
    for said in (
        "# crane: ",
        "`softstart export --as fmu`",
        "| `torque` | input | N m |",
        "gap = 0.6",
        "SHA-256",
    ):
        assert said in readme
    again = export_drive(CRANE.replace(gap=0.6), folder, prefix="crane", origin="softstart export --as fmu")
    assert dict(again.files) == dict(export.files)


def test_vectors_are_a_start() -> None:
    rows = list(csv.DictReader(vectors(CRANE).splitlines()))
    assert 100 < len(rows) < MOST
    assert float(rows[0]["torque"]) == CRANE.Ms
    assert [rows[0]["reached"], rows[-1]["reached"]] == ["0.0", "1.0"]
    assert {row["status"] for row in rows} == {"0.0"}
    peaks = [float(row["peak_shaft_torque"]) for row in rows]
    assert peaks == sorted(peaks)


def test_a_machine_begins_at_one_position() -> None:
    with pytest.raises(InputError, match="this question takes one position"):
        export_drive(CRANE.replace(start_position="unknown"))
