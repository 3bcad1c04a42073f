"""The passes of a step as kernels for a graphics card, which numba simulates here."""

import json
import os
import subprocess
import sys

from conftest import ROOT


def test_kernels_equal_the_loops_of_the_host():
    """Locks out kernels that leave the host's loops behind: an operation with another argument, a
    row that is not taken or put back, a thread behind the last body that writes, atoms of another
    body, heat that is counted twice. Bodies are of all kinds and of up to 70 atoms, in space and in
    a plane, and turn fast and slowly, exactly and split."""
    done = subprocess.run(
        [sys.executable, "-m", "validation.card"],
        cwd=ROOT,
        env=os.environ | {"NUMBA_ENABLE_CUDASIM": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    difference = json.loads(done.stdout)["difference"]
    assert difference.keys() == {"gather", "kick_and_rotate", "thermalise", "place"}
    assert all(one < 1e-12 for one in difference.values())
