"""Workers share the compiling: each part once, after its needs, and nobody goes on before all is compiled."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from tests import kernels


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_each_part_is_compiled_once_and_after_its_needs(
    workers: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []
    ended: list[str] = []

    def compiles(name: str, needs: tuple[str, ...]) -> None:
        assert set(needs) <= set(ended)
        begun.append(name)
        time.sleep(0.01)
        ended.append(name)

    parts = {
        name: (needs, lambda name=name, needs=needs: compiles(name, needs))  # type: ignore[misc]
        for name, (needs, _) in kernels.PARTS.items()
    }
    monkeypatch.setattr(kernels, "PARTS", parts)
    seen: list[int] = []

    def work() -> None:
        kernels.compile_together(tmp_path)
        seen.append(len(ended))

    threads = [threading.Thread(target=work) for _ in range(workers)]
    for one in threads:
        one.start()
    for one in threads:
        one.join(30.0)
    assert sorted(begun) == sorted(parts)
    assert seen == [len(parts)] * workers


def test_a_part_that_fails_keeps_nobody_waiting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise RuntimeError("no compiler")

    monkeypatch.setattr(kernels, "PARTS", {"drive": ((), fails)})
    with pytest.raises(RuntimeError, match="no compiler"):
        kernels.compile_together(tmp_path)
    began = time.monotonic()
    kernels.compile_together(tmp_path)  # another worker goes on; its tests will say what is wrong
    assert time.monotonic() - began < kernels.PATIENCE / 10.0
