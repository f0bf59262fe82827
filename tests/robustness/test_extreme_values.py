"""Every number of a machine, absurdly small and large: an answer or one sentence, in bounded memory and time.

Each row of cells runs in a child process whose memory is limited: a start that fills it dies there.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from tests.patience import patient

from softstart import Chain, Drive

MEMORY = 3 << 30  # bytes of address space
SECONDS = 12.0  # of processor time for one start
VALUES = (1e-12, 1e6, 1e9, 1e12, 1e300, -1e12)
CHILD = """
import json, resource, sys, time
resource.setrlimit(resource.RLIMIT_AS, ({memory}, {memory}))
from softstart import InputError, SimulationError, simulate
from softstart.cli.options import read_machine
machine, keys, values, controllers = json.loads(sys.argv[1])
for key in keys:
    for value in values:
        for controller in controllers:
            began = time.process_time()
            try:
                simulate(read_machine(machine, [f"{{key}}={{value}}"]), controller)
                said = ""
            except (InputError, SimulationError) as error:
                said = str(error)
            cell = f"{{key}}={{value:g}} {{controller}}"
            print(json.dumps([cell, time.process_time() - began, said]), flush=True)
"""


def cells(machine: str, keys: list[str], values: tuple[float, ...], controllers: tuple[str, ...]):
    given = json.dumps([machine, keys, values, controllers])
    words = [sys.executable, "-c", CHILD.format(memory=MEMORY), given]
    limit = patient(SECONDS * len(keys) * len(values) * len(controllers))
    ended = subprocess.run(words, capture_output=True, text=True, check=False, timeout=limit)
    rows = [json.loads(line) for line in ended.stdout.splitlines()]
    assert ended.returncode == 0, (rows[-1:], ended.stderr[-2000:])
    assert len(rows) == len(keys) * len(values) * len(controllers)
    return rows


def numbers(tables, part: str = "") -> list[str]:
    """The parameters that are a number, as --set names them; of those of many parts the second one."""
    return [
        f"{table.name}{part if table.many else ''}.{one.key}"
        for table in tables
        for one in table.parameters
        if one.unit and not one.many
    ]


DRIVE, CHAIN = numbers(Drive.TABLES), numbers(Chain.TABLES, "[2]")
GROUPS = [
    (machine, keys[begin::8])
    for machine, keys in (("crane-4amtkf", DRIVE), ("crane-4-mass", CHAIN))
    for begin in range(8)
]


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "keys"), GROUPS)
def test_an_absurd_value_ends_in_bounded_memory_and_time(machine: str, keys: list[str]) -> None:
    for cell, seconds, said in cells(machine, keys, VALUES, ("direct", "state-feedback")):
        assert seconds < SECONDS, (cell, seconds)
        assert said.count("\n") < 12, (cell, said)
        assert not said or said.rstrip()[-1] in ".?", (cell, said)
