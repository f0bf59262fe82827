"""The faults of `faults.toml` can be planted; `python tests/faults.py` runs the tests that must find them."""

from __future__ import annotations

import tomllib

import pytest
from tests.faults import ROOT


@pytest.mark.skipif(not (ROOT / "src").is_dir(), reason="needs the sources")
def test_every_fault_can_be_planted() -> None:
    for fault in tomllib.loads((ROOT / "tests" / "faults.toml").read_text(encoding="utf-8"))["fault"]:
        source = (ROOT / fault["path"]).read_text(encoding="utf-8")
        assert source.count(fault["right"]) == 1, fault["meaning"]
        assert fault["wrong"] != fault["right"]
        assert all((ROOT / "tests" / one).exists() for one in fault["tests"].split()), fault["meaning"]
