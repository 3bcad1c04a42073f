"""Words of thermostats, barostats and hybrid Monte Carlo that cannot be, and what
cannot be beside them: each ends the run with one message, which names what is wrong."""

from typing import NamedTuple

import pytest

from support.fixes import (
    NPT_CELL,
    POINTS,
    THERMOSTATS,
    fix_hmc,
    fix_moments,
    fix_mtk,
    fix_npt,
    fix_nvt,
    fix_nvt_with_points,
)
from support.sampling import SMOOTH
from support.systems import mixture

KINDS = "planar pair row single"
SYSTEMS = {
    "": mixture(side=2),
    "tilted": mixture(side=2, tilt=0.1),
    "near": mixture(side=2, spacing=2.9),
    "flat": mixture(KINDS, side=2, dimension=2),
    "flat and tilted": mixture(KINDS, side=2, dimension=2, tilt=0.1),
    "one body": mixture("solid", side=1),
}


class Refused(NamedTuple):
    """A script's lines behind its atoms, and what the message says.

    Attributes:
        system: of SYSTEMS.  ranks: how many there are.
    """

    lines: str
    says: str
    system: str = ""
    ranks: int = 1


def native(words):
    """The line of a fix, without what its words need."""
    style, group, rest = words.split(maxsplit=2)
    return f"fix 1 {group} nosquish/{style.lower()} {rest}\n"


LOOSE = "group loose molecule 1\ngroup stiff subtract all loose\n"
STIFF = "group stiff molecule 1 2 3\ngroup rest subtract all stiff\n"
COLD = "velocity all set 0 0 0\n"
TRAJECTORIES = fix_hmc("temp 2 steps 10 seed 5")
BREAKS = "an axis of the box would change by more than a factor of 2"
FAR = "iso 1e9 1e9 4e-1 every 5"

OF_THERMOSTATS = [
    ("temp 2 2 1", "keyword seed is missing"),
    ("seed 5", "keyword temp is missing"),
    ("temp 2 2", "the fix line ends where TDAMP (of TSTART, TSTOP and TDAMP"),
    ("temp 2 2 seed 5", "'seed' was given where TDAMP (of TSTART, TSTOP and TDAMP"),
    ("points rest", "keyword 'points': it is called flexible now: flexible GROUP"),
    ("", "keywords temp and seed are missing: give temp (TSTART, TSTOP and TDAMP, each"),
    ("temp 0 2 1 seed 5 thermostat csvr", "TSTART is 0, and must be above zero"),
    ("temp 2 -1 1 seed 5", "TSTOP is -1, and must be above zero"),
    ("temp 2 2 0 seed 5", "TDAMP is 0, and must be above zero"),
    ("temp 2 2 x seed 5", "'x' was given where"),
    ("temp 2 2 v_none seed 5", "there is no variable 'none'"),
    ("temp 2 2 1 seed 0", "'0' was given where a whole number"),
    ("temp 2 2 1 seed 2147483648", "from 1 to 2147483647 is expected"),
    ("temp 2 2 1 thermostat berendsen", "'berendsen' was given where one of langevin, csvr, nh"),
    ("temp 2 2 1 thermostat nh seed 5", "keyword seed has no effect"),
    ("temp 2 2 1 tchain 5 seed 5", "keyword tchain has no effect"),
    ("temp 2 2 1 thermostat nh tchain 4294967296", "'4294967296' was given where"),
    (
        "temp 2 2 1 seed 5 separate yes",
        "keyword separate has no effect with Langevin's",
    ),
]
BESIDE_THERMOSTATS = [
    ("fix 2 all langevin 2 2 1 5", "fix 2 (style langevin) keeps a temperature of atom"),
    ("fix 2 all temp/csvr 2 2 1 5", "fix 2 (style temp/csvr) keeps a temperature of atom"),
]
OF_POINTS = [
    ("group loose molecule 1 2\ngroup stiff union all", "is in a rigid body, and in group 'loose'"),
    ("group stiff union all", "there is no group 'loose'"),
    (f"{POINTS}fix 2 loose nve", "is also integrated by fix 2 (style nve)"),
]
OF_MOMENTS = [
    ("moments equal 0", "keyword moments: equal is 0, and must be above zero"),
    ("moments scale -1", "keyword moments: scale is -1, and must be above zero"),
    ("moments 6", "'6' was given where equal VALUE"),
    ("moments equal", "the fix line ends where equal VALUE"),
    ("moments step 6", "unknown keyword '6'"),
]
OF_BAROSTATS = [
    ("", "the pressure is missing"),
    ("iso 1 1", "the fix line ends where PDAMP (of PSTART, PSTOP and PDAMP"),
    ("iso 1 1 1", "keyword compressibility is missing: with units lj it has no default"),
    ("iso 1 1 1 x 1 1 1", "use only one of iso"),
    ("iso 1 1 1 couple xy", "keyword couple is for aniso"),
    ("x 1 1 1 y 1 1 2 compressibility 1", "PDAMP is 1 for one axis and 2 for another"),
    (
        "x 1 1 1 y 2 2 1 couple xy compressibility 1",
        "and PDAMP 2 2 1, and an axis coupled to it 1 1 1",
    ),
    ("x 1 1 1 couple xy compressibility 1", "keyword couple xy: give each of these axes"),
    ("z 1 1 1 couple xy compressibility 1", "keyword couple xy: give each of these axes"),
    ("x 1 1 1 x 1 1 1 compressibility 1", "keyword x is given twice"),
    ("iso 1 1 0 compressibility 1", "PDAMP is 0, and must be above zero"),
    ("iso 1 1 1 compressibility 0", "keyword compressibility is 0, and must be above zero"),
    ("aniso 1 1 1 couple yx", "'yx' was given where one of none, xyz"),
    ("iso 1 1 1 compressibility 1 force * off on on", "for a box that does not change"),
]
OF_PISTONS = [
    ("NPH all molecule iso 1 1 1 every 4294967296", "'4294967296' was given where"),
    ("NPT all molecule temp 2 2 1 iso 1 1 1 barostat mtk", "keyword seed is missing"),
    (
        "NPT all molecule temp 2 2 1 seed 3 iso 1 1 1 barostat mtk compressibility 8",
        "keyword compressibility has no effect with Langevin's thermostat, and the piston of",
    ),
    ("NPT all molecule temp 2 2 1 seed 3 iso 1 1 1 barostat nh", "one of crescale, mtk"),
    ("NPH all molecule temp 2 2 1 iso 1 1 1", "this integrator has no thermostat"),
    ("NPH all molecule every 5", "the pressure is missing"),
    ("NPH all molecule iso 1 1 0", "PDAMP is 0, and must be above zero"),
]
OF_TILTS = [
    ("NPH all molecule tri 1 1 1", "this one is orthogonal", ""),
    ("NPH all molecule xy 1 1 1", "this one is orthogonal", ""),
    ("NPH all molecule tri 1 1 1 iso 1 1 1", "use only one of iso", "tilted"),
    ("NPH all molecule tri 1 1 1 xy 1 1 1", "use only one of iso", "tilted"),
    ("NPH all molecule xy 1 1 1 yz 1 1 1", "xz must change, too", "tilted"),
    ("NPH all molecule xz 1 1 1", "the box has no length along z", "flat and tilted"),
    ("NPH all molecule z 1 1 1", "in two dimensions the box has no length along z", "flat"),
    ("NPH all molecule aniso 1 1 1 couple xz", "leave out xz", "flat"),
    ("NPH all molecule iso 1 1 1", "no centre of mass can move against another", "one body"),
]
BESIDE_BAROSTATS = [
    ("fix 2 all deform 10 x scale 1.1", "Must not have multiple fixes change box parameter x"),
    ("change_box all boundary p p f", "there is no pressure along z, which is not periodic"),
    ("run_style respa 2 2 pair 2", "use run_style verlet"),
]
OF_TRAJECTORIES = [
    ("", "keywords temp, steps and seed are missing: give temp (T, a number"),
    ("temp 2 steps 10", "keyword seed is missing: give it a whole number"),
    ("temp 2 seed 5", "keyword steps is missing: give it a whole number"),
    ("steps 10 seed 5", "keyword temp is missing: give it T, a number"),
    ("temp 0 steps 10 seed 5", "keyword temp: T is 0, and must be above zero"),
    ("temp 2 2 1 steps 10 seed 5", "unknown keyword '2'"),
    ("temp 2 steps 0 seed 5", "'0' was given where a whole number of at least 1"),
    ("temp 2 steps 10 seed 5 mix 0", "keyword mix is 0, and must be above 0 and at most 1"),
    ("temp 2 steps 10 seed 5 mix 2", "keyword mix is 2, and must be above 0 and at most 1"),
    ("temp 2 steps 10 seed 5 thermostat nh", "unknown keyword 'thermostat'"),
    ("temp 2 steps 10 seed 5 force 1 off on on", "keywords force and torque cannot be used"),
    ("temp 2 steps 7 seed 5", "the run ends in step 10, within a trajectory"),
]
BESIDE_TRAJECTORIES = [
    ("fix 2 all langevin 2 2 1 5", "fix 2 (style langevin) may change positions, momenta"),
    ("fix 2 rest nve", "fix 2 (style nve) may change"),
    ("fix 2 all momentum 10 linear 1 1 1", "fix 2 (style momentum) may change"),
    ("fix 2 all deform 10 x scale 1.1", "fix 2 (style deform) may change"),
    ("fix 2 all addforce 0 0 1", "test: fix_modify 2 energy yes, or use fix nosquish/nvt"),
    ("fix 2 rest viscous 1", "fix 2 (style viscous) may change"),
    (
        "fix 2 rest nosquish/nve molecule",
        'fix 2 ("nosquish/nve molecule") moves bodies besides hybrid Monte Carlo',
    ),
    ("comm_modify vel yes", "needs forces that do not depend on velocities"),
    ("run_style respa 2 2", "the integrator nosquish/hmc does not support run_style respa"),
]
# of forces that hybrid Monte Carlo is given: variables, words, and which of them is refused
# keywords of others that NVE would take and ignore
OF_NVE = [
    ("temp 2 2 1", "has no thermostat: use fix nosquish/nvt or fix nosquish/npt"),
    ("steps 10", "it is a keyword of fix nosquish/hmc"),
]

REFUSED = [
    *(Refused(native(f"NVT all molecule {words}"), says) for words, says in OF_THERMOSTATS),
    *(
        Refused(f"{before}\n{fix_nvt(THERMOSTATS['csvr'])}", says, ranks=2)
        for before, says in BESIDE_THERMOSTATS
    ),
    Refused(
        fix_nvt(f"{THERMOSTATS['csvr']} torque * off off on"),
        "keyword torque has one component off and another one on",
        ranks=2,
    ),
    Refused(
        f"{fix_nvt(THERMOSTATS['csvr'])}thermo_style custom step\nrun 5\nreset_timestep 0\n"
        "run 5 pre no\n",
        "the step counter has gone back",
        ranks=2,
    ),
    *(
        Refused(
            f"{before}\n{fix_nvt_with_points(THERMOSTATS['langevin']).replace(POINTS, '')}", says
        )
        for before, says in OF_POINTS
    ),
    *(Refused(fix_moments(f"seed 1 {words}"), says) for words, says in OF_MOMENTS),
    *(Refused(fix_npt("seed 5", words), says) for words, says in OF_BAROSTATS),
    Refused(fix_npt("", f"thermostat nh {NPT_CELL}"), "2147483647, because this barostat draws"),
    *(Refused(COLD + native(line), says) for line, says in OF_PISTONS),
    *(Refused(native(line), says, system) for line, says, system in OF_TILTS),
    *(
        Refused(f"change_box all boundary s p p\n{native(line)}", says, "tilted", 2)
        for line, says in (
            ("NPH all molecule tri 1 1 1", "no pressure along x, which is not"),
            ("NPH all molecule xz 1 1 1", "and no tilt xz"),
        )
    ),
    Refused(
        f"{LOOSE}{native('NPH stiff molecule tri 1 1 1 dilate none')}",
        "there is no group none",
        "tilted",
    ),
    Refused(
        f"{LOOSE}{native('NPH stiff molecule iso 1 1 1 dilate')}",
        "the fix line ends where the ID of a group, whose atoms",
    ),
    *(Refused(f"{before}\n{fix_npt('seed 5')}", says) for before, says in BESIDE_BAROSTATS),
    Refused(
        LOOSE + fix_npt("seed 5").replace("fix 1 all", "fix 1 stiff"),
        "atoms are in no body",
    ),
    Refused(
        f"{LOOSE}fix 2 loose nosquish/nve molecule\n"
        + fix_npt("seed 5").replace("fix 1 all", "fix 1 stiff"),
        "would not follow the box that this fix changes",
    ),
    Refused(
        f"{fix_npt('seed 5')}change_box all triclinic\n",
        "Cannot change box ortho/triclinic with certain fixes defined",
    ),
    Refused(f"{fix_npt('seed 5')}run 5\nuncompute 1_virial\n", "compute 1_virial is gone"),
    *(
        Refused(f"{SMOOTH}timestep 0.004\n{line}run 50\n", BREAKS, "near", 2)
        for line in (
            *(fix_mtk(name, FAR) for name in ("NPH", "langevin", "nh")),
            fix_npt("seed 5", f"{FAR} compressibility 1"),
        )
    ),
    Refused(
        f"{SMOOTH}timestep 0.004\n{fix_mtk('NPH')}thermo_style custom step vol\nrun 53\n"
        "reset_timestep 1000\nrun 20 pre no\n",
        "has not tallied the virial",
        "near",
    ),
    *(Refused(fix_hmc(words), says) for words, says in OF_TRAJECTORIES),
    *(
        Refused(
            f"{STIFF}{before}\n{fix_hmc('temp 2 steps 10 seed 5', group='stiff')}", says, ranks=2
        )
        for before, says in BESIDE_TRAJECTORIES
    ),
    *(
        Refused(
            f"{TRAJECTORIES}fix_modify 1 external {words}\n",
            "cannot be used with hybrid Monte Carlo",
            ranks=2,
        )
        for words in ("force 1 0 0 energy 0", "torque 0 0 1", "python")
    ),
    Refused(f"{TRAJECTORIES}run 20\nrun 15 pre no\n", "the run ends in step 35, within"),
    Refused(
        f"{TRAJECTORIES}run 20\nthermo_style custom step\nreset_timestep 0\nrun 20 pre no\n",
        "step 1 does not follow the last trajectory",
    ),
    *(Refused(native(f"NVE all molecule {words}"), says) for words, says in OF_NVE),
    # noise of which a part is no rigid motion: bodies were too cold, by 3/4 in a case
    Refused(
        f"{native('NVE all molecule')}fix 2 all temp/csld 2 2 1 5\n",
        "fix 2 (style temp/csld) gives each atom of the rigid bodies a velocity of its own",
        ranks=2,
    ),
]


@pytest.mark.parametrize("row", REFUSED, ids=lambda row: row.says)
def test_refused(refused, row):
    """Locks out words that are taken and mean nothing, or something else; and what would go wrong
    without a word, hang, or end with a traceback or a message of each rank."""
    system = SYSTEMS[row.system]
    refused(f"{system.setup}\n{row.lines}run 10\n", row.says, system.files, ranks=row.ranks)
