"""The command line: `softstart compare`, `simulate`, `optimize`, `pareto`, `drives`, `study` and more."""

import os
import signal
from threading import current_thread, main_thread

# Ctrl-C while this is imported ends the command without a traceback; `main` takes over then
_begins = current_thread() is main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
if _begins:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from softstart.processes import ONE_THREAD  # noqa: E402

for _name, _count in ONE_THREAD.items():
    os.environ.setdefault(_name, _count)  # before numpy is imported

from softstart.cli.main import main  # noqa: E402

if _begins:
    signal.signal(signal.SIGINT, signal.default_int_handler)

__all__ = ["main"]
