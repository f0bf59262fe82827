"""What is done when a process is ended at once."""

from __future__ import annotations

import subprocess
import sys

# the handler of a signal begins the end in the main thread, another thread carries it out a moment later
LEFT = """
from softstart.stopping import STOPPING, at_stop, stop_now

try:
    with at_stop(lambda: print("before", flush=True)):
        pass
    with at_stop(lambda: print("outer", flush=True)), at_stop(lambda: print("inner", flush=True)):
        STOPPING.set()
        raise KeyboardInterrupt
except KeyboardInterrupt:
    stop_now(130)
"""


def test_what_is_left_while_the_process_is_being_ended_is_still_done():
    done = subprocess.run(
        [sys.executable, "-c", LEFT], check=False, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stdout.split(), done.stderr) == (130, ["inner", "outer"], "")
