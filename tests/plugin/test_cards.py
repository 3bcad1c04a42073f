"""Forces on a graphics card: what LAMMPS copies for the fix, and what ends a run.

No test needs a card. `card.cpp` sees in any LAMMPS what the fix changes, and what it tells KOKKOS.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fix_nosquish.errors import RunError
from fix_nosquish.host.hosts import OtherFix
from fix_nosquish.run.cards import Cards
from fix_nosquish.run.other_fixes import OtherFixes
from support.builds import OLD_STRINGS, PREFIX, mpi_folder
from support.debian import ICE, ice
from support.running import BIN, ROOT
from validation.running import startup

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
        needs = FREE | ({asked: True} if asked else {})
        if cards not in refused:
            cards.refuse(**needs)
            continue
        with pytest.raises(RunError, match=refused[cards]):
            cards.refuse(**needs)


@pytest.mark.parametrize("word", ["mixed", "single"])
def test_precision_of_kokkos(word):
    """Locks out bodies whose atoms LAMMPS has elsewhere, by rounding."""
    for cards in HOST, CARD:
        with pytest.raises(RunError, match=f"this KOKKOS has {word} precision"):
            cards._replace(kokkos=word).refuse(**FREE)


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
         *OLD_STRINGS,
         "-I", PREFIX / "include/lammps", "-I", mpi_folder(),
         ROOT / "tests/support/card.cpp", "-o", made],
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


# bits of X, V, MU, OMEGA and ANGMOM in the atom_masks.h of a version, None where it was not read
BITS = {
    20240829: (0, 1, 18, 22, 24),
    20250204: (0, 1, 18, 22, 24),
    20250722: (0, 1, 18, 22, 24),
    20251210: None,
    20260704: (0, 1, 17, 35, 37),
}
NAMES = [f"{name}_MASK" for name in ("X", "V", "MU", "OMEGA", "ANGMOM")]


def masks(folder, version, *before):
    """The masks by these names that the plugin has if it is compiled for a version, with headers in
    the folders `before` those of this LAMMPS."""
    program = folder / "names.cpp"
    program.write_text(f'#include "lammps_versions.h"\nMASKS {" ".join(NAMES)}\n')
    folders = *before, PREFIX / "include/lammps", mpi_folder(), startup.package() / "plugin"
    includes = [word for one in folders for word in ("-I", one)]
    words = ["g++", "-std=c++17", "-E", f"-DCOMPILED_FOR_LAMMPS={version}", *includes, program]
    text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    named = dict(re.findall(r"(\w+_MASK) = ([^,}]+)", text))
    results = re.search(r"^MASKS (.*)", text, re.MULTILINE)[1].split()
    for _ in named:  # one is named by another
        results = [named.get(one, one).strip() for one in results]
    return [eval(one.replace("ULL", "")) for one in results]


@pytest.mark.parametrize("version", BITS)
def test_bits_of_versions(tmp_path, version):
    """Locks out arrays that KOKKOS does not hear of, because a LAMMPS has them at other bits than
    another one: without LAMMPS's own header the bits are those of the version that was read, and
    all for others. LAMMPS_SOURCE names source trees to look at, too."""
    bits = BITS[version]
    expected = [-1] * 5 if bits is None else [1 << bit for bit in bits]
    assert masks(tmp_path, version) == expected
    for tree in map(Path, os.environ.get("LAMMPS_SOURCE", "").split()):
        date = re.search(r'"(.*)"', (tree / "src/version.h").read_text())[1]
        if version == int(time.strftime("%Y%m%d", time.strptime(date, "%d %b %Y"))):
            text = (tree / "src/atom_masks.h").read_text()
            there = dict(re.findall(r"#define (\w+) +(0x\w+)", text))
            assert [int(there[name], 16) for name in NAMES] == expected


def test_bits_of_the_header(tmp_path):
    """Locks out a LAMMPS whose own header gives an array another bit than the version that was
    read, and is not asked."""
    lines = (f"#define {name} {1 << 40 + k:#018x}" for k, name in enumerate(NAMES))
    (tmp_path / "atom_masks.h").write_text("\n".join(lines) + "\n")
    assert masks(tmp_path, 20250722, tmp_path) == [1 << 40 + k for k in range(5)]


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
