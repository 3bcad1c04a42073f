"""The processes that scripts share: what one script does to them does not reach the next."""

import subprocess

import pytest

SCRIPT = """
units lj
atom_style atomic
region box block 0 4 0 4 0 4
create_box 1 box
create_atoms 1 single 1 1 1
mass 1 1.0
pair_style none
variable left equal 1
fix 1 all python/move "mover.Mover"
run 1
"""
MOVER = """
import os, time

print("of script {number}", flush=True)

class Mover:
    def __init__(self, ptr): pass
    def initial_integrate(self, vflag):
        if os.environ["PMI_RANK"] == "1":
            {act}
    def final_integrate(self): pass
"""


def test_scripts_are_apart(sessions, tmp_path):
    """Locks out a script that runs with another one's modules or variables, on some ranks, or in
    its folder; and a rank that ends, breaks or hangs without a word, or for good."""

    def run(number, act="pass", timeout=60):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "in.test").write_text(SCRIPT)
        (folder / "mover.py").write_text(MOVER.format(number=number, act=act))
        code, screen = sessions(2).run(folder, [], timeout)
        assert screen.count(f"of script {number}") == screen.count("of script") == 2
        assert (folder / "log.lammps").exists()
        return code, screen

    first = sessions(2)
    for number in 0, 1:
        code, screen = run(number)
        assert code == 0 and screen.count("Loop time") == 1
    assert sessions(2) is first
    for number, act in (2, "os._exit(0)"), (3, "os.abort()"), (4, "raise ValueError('no luck')"):
        code, screen = run(number, act)
        assert code != 0, act
    assert screen.count("ERROR on proc 1: Fix 1 python/move: ValueError: no luck") == 1
    with pytest.raises(subprocess.TimeoutExpired):
        run(5, "time.sleep(1000)", timeout=5)
    assert run(6)[0] == 0
    assert sessions(2) is not first
