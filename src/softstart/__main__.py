"""`python -m softstart`: the command `softstart`."""

import os
import sys

# `python -m` looks for modules in the current folder first: a file there could stand in for any library
if sys.path[:1] == [os.getcwd()]:
    del sys.path[0]

from softstart.cli import main

sys.exit(main())
