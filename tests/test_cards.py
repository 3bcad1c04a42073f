"""Forces on a graphics card: what LAMMPS copies for the fix, and what ends a run.

No test needs a card. `card.cpp` sees in any LAMMPS what the fix changes, and what it tells KOKKOS.
"""

import re
import shutil
import subprocess
import sys

import pytest
from conftest import BIN, ROOT
from test_build import PREFIX, mpi_folder
from test_own_fix import ICE, ice

from fix_nosquish.host.hosts import OtherFix
from fix_nosquish.run.cards import Cards
from fix_nosquish.run.other_fixes import OtherFixes

LMP = str(BIN / "lmp")
FILES = "card.py", "in.card", "data.water", "forcefield.water"
FIXED = {"nosquish": "2.0", "shake": "2.0", "heavy": "10.0"}
FREE = dict(energy=False, levels=False, counts=False)
NONE, GPU, HOST = Cards(), Cards(gpu="mixed"), Cards(kokkos="double")
CARD = HOST._replace(number=1)


@pytest.mark.parametrize(
    "asked, refused",
    [
        ("", {}),
        ("counts", {GPU: "package GPU adds its forces where fixes add theirs"}),
        ("energy", {CARD: "hybrid Monte Carlo has forces computed anew"}),
        (
            "levels",
            {
                GPU: "begins a run with the forces of pairs in the outermost level",
                CARD: "run_style respa has forces computed by levels",
            },
        ),
    ],
)
def test_what_would_be_wrong(asked, refused):
    """Locks out a run on a card that goes wrong without a word, and one that is refused for what
    does no harm with other packages."""
    for cards in NONE, GPU, HOST, CARD:
        problem = cards.problem(**FREE | ({asked: True} if asked else {}))
        assert (refused[cards] in problem) if cards in refused else (problem == "")


@pytest.mark.parametrize("word", ["mixed", "single"])
def test_precision_of_kokkos(word):
    """Locks out bodies whose atoms LAMMPS has elsewhere, by rounding."""
    for cards in HOST, CARD:
        problem = cards._replace(kokkos=word).problem(**FREE)
        assert f"this KOKKOS has {word} precision" in problem


def test_fixes_of_packages():
    """Locks out velocities at the half step, and refusals, for a fix by which LAMMPS's package GPU
    brings its forces: the user has not asked for it."""
    facts = dict.fromkeys(OtherFix.__annotations__, False)
    facts |= dict(id="package_gpu", style="GPU", groupbit=1, nevery=1)
    facts |= dict(between=True, called=True, post_force=True)
    gpu = OtherFix(**facts)
    fixes = OtherFixes([gpu, gpu._replace(id="5", style="addforce")])
    assert fixes.packages == {"GPU"} and [fix.id for fix in fixes] == ["5"]
    assert not OtherFixes([gpu]).half_step and not OtherFixes([gpu]).change_forces


@pytest.fixture(scope="module")
def card(tmp_path_factory):
    """The plugin of card.cpp, compiled for the LAMMPS that there is."""
    made = tmp_path_factory.mktemp("card") / "cardplugin.so"
    subprocess.run(
        ["g++", "-std=c++17", "-shared", "-fPIC", "-DLAMMPS_SMALLBIG", "-DMPICH_SKIP_MPICXX",
         "-I", PREFIX / "include/lammps", "-I", mpi_folder(), ROOT / "tests/card.cpp", "-o", made],
        check=True,
    )  # fmt: skip
    return made


FIXES = {
    "nve": "nosquish/nve molecule",
    "nvt": "nosquish/nvt molecule temp 300 300 50 thermostat csvr seed 4",
    "npt": "nosquish/npt molecule temp 300 300 50 iso 0 0 500 seed 4",
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("fix", FIXES)
def test_masks(run_lammps, card, fix, ranks):
    """Locks out changes that never get to a card, as the fix does not tell KOKKOS of them."""
    forcefield = ROOT / "inputs/water/forcefield.water"
    script = (
        f"plugin load {card}\n{ICE.format(forcefield=forcefield)}group none empty\n"
        f"fix 8 none nve/card/before\nfix ours water {FIXES[fix]}\nfix 9 none nve/card/after\n"
        "neigh_modify every 1 delay 4 check no\ntimestep 1.0\nthermo_style custom step f_9\n"
        "run 20\n"
    )
    run = run_lammps(script, files={"data.ice": ice()}, ranks=ranks)
    assert run.thermo["f_9"][-1] >= 20, "positions, in each step"


def test_script_for_a_card(tmp_path):
    """Locks out a script for machines with a card that does not run, that does not see a difference
    or sees one where there is none, and one whose fixes are not what they are named after."""
    for name in FILES:
        shutil.copy(ROOT / "inputs/water" / name, tmp_path)
    commands = LMP, f"{LMP} -sf opt"
    run = [sys.executable, "card.py", *commands, "20", "1"]
    screen = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    apart = float(re.search(r"positions differ by (\S+)", screen)[1])
    assert 0 < apart < 1e-11
    rows = dict(line.split(maxsplit=1) for line in screen.splitlines()[-3:])
    assert [rows[fix].split()[:2] for fix in FIXED] == [["3000", dt] for dt in FIXED.values()]
    logs = {fix: (tmp_path / f"log.{fix}.1").read_text() for fix in FIXED}
    assert ["Rigid bodies by" in logs[fix] for fix in FIXED] == [True, False, True]
