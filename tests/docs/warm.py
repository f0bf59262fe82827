"""What the process that forks has done before: everything is imported, and the kernels are loaded."""

import contextlib
import io
import threading

import casadi  # noqa: F401
import control  # noqa: F401
import matplotlib.backends.backend_agg
import matplotlib.figure  # noqa: F401
import xarray  # noqa: F401
import zarr  # noqa: F401

from softstart.cli import main

with contextlib.redirect_stdout(io.StringIO()):
    for line in ("compare", "optimize --start-time 1.2x"):
        assert main(line.split()) == 0
for thread in threading.enumerate()[1:]:  # a process with threads is not to be forked
    if thread.name != "softstart-watch":  # which sleeps and does not end; a fork starts one of its own
        thread.join()
