"""Forces on a graphics card: what LAMMPS copies for the fix, and what ends a run.

No test needs a card. Where KOKKOS copies, `card.cpp` imitates it in any LAMMPS.
"""

import subprocess

import numpy as np
import pytest
from conftest import ROOT, read_thermo
from test_build import PREFIX, mpi_folder
from test_own_fix import ICE, ice

from fix_nosquish.host.hosts import OtherFix
from fix_nosquish.run.cards import Cards
from fix_nosquish.run.other_fixes import OtherFixes

FREE = dict(energy=False, flips=False, held=False, counts=False)
HOST, CARD = Cards(kokkos="double"), Cards(kokkos="double", number=1)


@pytest.mark.parametrize(
    "cards, asked, said",
    [
        (Cards(gpu="mixed"), "counts", "package GPU adds its forces where fixes add theirs"),
        (Cards(kokkos="mixed"), None, "this KOKKOS has mixed precision"),
        (Cards(kokkos="single", number=1), None, "this KOKKOS has single precision"),
        (CARD, "energy", "hybrid Monte Carlo moves atoms back"),
        (CARD, "flips", "tilts that change send atoms to other ranks"),
        (CARD, "held", "the box moves atoms that fix shake or rattle holds"),
    ],
)
def test_what_would_be_wrong(cards, asked, said):
    """Locks out a run on a card that goes wrong without a word, and one that is refused for what
    does no harm: the same beside another package, and all else beside this one."""
    problem = cards.problem(**FREE | ({asked: True} if asked else {}))
    assert problem.startswith(said) or said in problem
    others = (Cards(), HOST, CARD, Cards(gpu="mixed"))
    harmless = [other for other in others if bool(other.gpu) != bool(cards.gpu) or not asked]
    for other in harmless:
        if not other.number or not asked:
            assert not other.problem(**FREE | ({asked: True} if asked else {}))


def test_what_the_log_says():
    """Locks out a log without the bytes that cross the bus, or with some where there are none."""
    assert Cards().copies(1000) == []
    (gpu,) = Cards(gpu="mixed").copies(1000)
    assert "mixed precision" in gpu and "nothing is copied" in gpu
    (host,) = HOST.copies(1000)
    assert host == "  KOKKOS on the host: nothing is copied"
    (card,) = CARD.copies(10**6)
    assert " 72 MB " in card and "not tried on a card" in card


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
def test_masks(run_lammps, card, ranks):
    """Locks out forces or positions that stay on a card although the fix needs them, and changes
    that never get there. Some steps look at velocities and pressure, and some make lists anew; in
    others the fix has nothing to do at the end of a step."""
    start = ICE.format(forcefield=ROOT / "inputs/water/forcefield.water") + "group none empty\n"
    parts = []
    for fix in FIXES.values():
        for first, last in ("", ""), ("fix 8 none nve/card/before", "fix 9 none nve/card/after"):
            parts.append(
                f"clear\n{start}{first}\nfix ours water {fix}\n{last}\n"
                "neigh_modify every 1 delay 4 check no\nthermo 3\ntimestep 1.0\n"
                f"thermo_style custom step temp press pe etotal {'f_8' if first else 'dt'}\n"
                "thermo_modify format float %.17g\nrun 20\n"
            )
    files = {"data.ice": ice()}
    run = run_lammps(f"plugin load {card}\n" + "".join(parts), files=files, ranks=ranks)
    tables = [read_thermo(log) for log in run.log.split("Rigid bodies by")[1:]]
    assert len(tables) == 2 * len(FIXES)
    for name, host, there in zip(FIXES, tables[::2], tables[1::2], strict=True):
        for column in "Temp", "Press", "PotEng", "TotEng":
            np.testing.assert_array_equal(there[column], host[column], err_msg=f"{name} {column}")
        assert there["f_8"][-1] > 0, "no array was on the card alone"
