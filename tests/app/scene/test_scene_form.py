from __future__ import annotations

import subprocess
import sys


def test_a_form_is_built_without_the_solver():
    """A run builds its mannequin and form in a process of its own while it loads the solver."""
    program = "import sys, warpflat.app.scene.form; sys.exit('warp' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
