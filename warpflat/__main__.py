"""``python -m warpflat`` is the command line."""

from __future__ import annotations

import sys

from warpflat.cli import main

sys.exit(main())
