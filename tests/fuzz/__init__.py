"""Fuzzing of the command line; the helpers of all tests can be imported here, too, however it is started."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
