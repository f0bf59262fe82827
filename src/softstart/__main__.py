"""`python -m softstart`: the command `softstart`."""

import sys

from softstart.cli import main

sys.exit(main())
