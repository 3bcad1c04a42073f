"""Every kind of box, and every way to share a box out among ranks,
against LAMMPS's fix rigid/nve in the same set-up.

`order 123` throughout, and bodies of three moments (in the plane any):
there the two have one trajectory.
"""

import itertools
import re

import numpy as np
import pytest

from support.running import read_thermo
from support.systems import (
    AFTER,
    LIKE_LAMMPS,
    RIGID,
    System,
    assemble,
    assert_same,
    droplet,
    mixture,
    turned,
)

# a column that changes whenever an atom changes its rank
OWNER = (
    "compute proc all property/atom proc\nvariable owner atom (c_proc+1)*id*id\n"
    "compute owner all reduce sum v_owner"
)


# ---- boxes


def apart_at(speed):
    """Commands that add velocities which drive the atoms away from the middle of the box."""
    return "\n".join(
        f"velocity all ramp v{k} -{speed} {speed} "
        f"{k} $(bound(all,{k}min)) $(bound(all,{k}max)) sum yes units box"
        for k in "xyz"
    )


CHARGED = """fix q all property/atom q ghost yes
set type 1 charge 0.5
set type 2 charge -0.4
pair_style lj/cut/coul/long 2.5 2.5
pair_coeff * * 1.0 1.0
kspace_style pppm 1e-4
kspace_modify slab 3.0"""

BOXES = {
    "tilted": lambda: (mixture("solid planar", tilt=0.9, setup="box tilt large"), ""),
    "tilted to the left": lambda: (
        mixture("solid planar", tilt=-1.3, seed=2, setup="box tilt large"),
        "",
    ),
    "plane": lambda: (mixture("planar pair row", side=5, dimension=2), "fix 9 all enforce2d"),
    "tilted plane": lambda: (
        mixture("planar pair row", side=5, tilt=0.9, dimension=2, setup="box tilt large"),
        "fix 9 all enforce2d",
    ),
    "fixed faces": lambda: (droplet("f f f", margin=3.0), apart_at(5)),
    "body as wide as the box": lambda: (
        droplet("s s s", spacing=(7.0, 2.55, 2.55)),
        "group ends molecule 1 27\nset group ends mol 28",
    ),
    "one periodic direction": lambda: (droplet("p f s", margin=3.0), ""),
    "slab with charges": lambda: (droplet("p p f", margin=3.0), CHARGED),
}


@pytest.mark.quick("tilted-2")
@pytest.mark.parametrize("box, ranks", list(zip(BOXES, itertools.cycle((2, 1)))))
def test_boxes(simulate, box, ranks):
    """Locks out wrong images of atoms across tilted faces, images of atoms across faces that are
    not periodic, and motion out of the plane; a body as wide as the box is not cut by such faces:
    each box moves its bodies as rigid/nve does."""
    system, before = BOXES[box]()
    theirs = simulate(system, RIGID, 50, before=before)
    ours = simulate(system, LIKE_LAMMPS, 50, before=before, ranks=ranks)
    assert_same(ours, theirs, system.h)


@pytest.mark.parametrize("ranks", [1, 2])
def test_tilted_box_without_image_flags(simulate, ranks):
    """Locks out molecules torn apart, and the wrong nearest image in a strongly tilted box,
    where a data file says 0 0 0 of bodies that faces cut; and a word on those that none cuts."""
    right, none = (
        mixture("planar", side=4, tilt=0.6, flags=flags, setup="box tilt large")
        for flags in (True, False)
    )
    ours = simulate(none, LIKE_LAMMPS, 30, ranks=ranks)
    assert re.search(r"\b\d\d bodies were cut by a periodic face", ours.log)
    assert "cut by a periodic face" not in simulate(right, LIKE_LAMMPS, 0).log
    assert_same(ours, simulate(right, RIGID, 30), right.h)


@pytest.mark.parametrize("boundary, ranks", [("s s s", 1), ("m m m", 2), ("p s f", 2)])
def test_box_that_grows(simulate, boundary, ranks):
    """Locks out the refusal of a box whose faces follow the atoms in mid-run,
    and bodies placed by the old box."""
    system = droplet(boundary, margin=3.0 if "f" in boundary else 0.05)
    how = dict(before=apart_at(10), columns="lx ly lz")
    theirs = simulate(system, RIGID, 60, **how)
    ours = simulate(system, LIKE_LAMMPS, 60, ranks=ranks, **how)
    assert_same(ours, theirs, system.h)
    for k, face in zip("xyz", boundary.split()):
        size = ours.thermo["L" + k]
        np.testing.assert_allclose(size, theirs.thermo["L" + k], rtol=1e-9)
        assert (size[-1] > size[0] + 1.0) == (face in "sm")


# ---- domains

EACH_STEP = "neigh_modify every 1 delay 0 check no"
# ranks, lines before read_data, lines before the fix, whether atoms must have changed their ranks
DOMAINS = {
    "layers": (2, "processors 1 1 *", EACH_STEP, True),
    "rods": (4, "processors * 1 1", EACH_STEP, True),
    "newton off": (2, "newton off", EACH_STEP, True),
    "newton on off": (2, "newton on off", "", False),
    "sorted each step": (2, "atom_modify sort 1 2.0", EACH_STEP, True),
    "never sorted": (2, "atom_modify sort 0 0", EACH_STEP, True),
    "hashed map": (2, "atom_modify map hash", EACH_STEP, True),
    "thin skin": (2, "", "neighbor 0.1 bin\n" + EACH_STEP, True),
    "rarely rebuilt": (2, "", "neighbor 1.0 bin\nneigh_modify every 20 delay 0 check yes", False),
}


@pytest.mark.parametrize("domains", DOMAINS)
def test_domains(simulate, domains):
    """Locks out atoms that bodies lose, or take for others, where LAMMPS shares out, re-orders, or
    looks up its atoms in another way than by default."""
    ranks, setup, before, moves = DOMAINS[domains]
    system = mixture("solid planar", temperature=8.0, setup=setup)
    alone = system._replace(setup=re.sub("processors .*", "", system.setup))
    steps = 20 if ranks > 2 else 40
    how = dict(before=f"{before}\n{OWNER}", columns="c_owner", every=5)
    theirs = simulate(alone, RIGID, steps, **how)
    ours = simulate(system, LIKE_LAMMPS, steps, ranks=ranks, **how)
    assert_same(ours, theirs, system.h)
    assert not moves or len(np.unique(ours.thermo["c_owner"])) > 3, (
        "hardly an atom has changed its rank"
    )


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("style, balance", [("brick", "shift xyz 10 1.0"), ("tiled", "rcb")])
def test_fix_balance(simulate, style, balance, first):
    """Locks out atoms lost, and arrays of LAMMPS read where they no longer are, when fix balance
    shares out atoms anew at the set-up and every five steps, before this fix or after it (with fix
    rigid it must be after)."""
    system = mixture("solid planar", temperature=8.0, setup=f"comm_style {style}\nprocessors * 1 1")
    alone = system._replace(setup=re.sub("processors .*", "", system.setup))
    line, how = f"fix 7 all balance 5 1.0 {balance}", dict(columns="c_owner", every=5)
    theirs = simulate(alone, f"{RIGID}\n{line}", 30, before=OWNER, **how)
    fixes = [line, LIKE_LAMMPS] if first else [LIKE_LAMMPS, line]
    ours = simulate(system, "\n".join(fixes), 30, ranks=2, before=OWNER, **how)
    assert_same(ours, theirs, system.h)
    assert len(np.unique(ours.thermo["c_owner"])) > 3, "hardly an atom has changed its rank"


def test_no_map(simulate):
    """Locks out a need for LAMMPS's map from IDs to atoms,
    which atom_style atomic has not by default."""
    system = mixture("solid planar", temperature=8.0)
    data = system.files["data.bodies"].replace("# molecular", "# atomic")
    atoms = data[data.index("Atoms") : data.index("Velocities")]
    data = data.replace(atoms, re.sub(r"(?m)^(\d+) \d+ ", r"\1 ", atoms))
    data += (
        "\nMembers\n\n" + "\n".join(f"{k + 1} {m}" for k, m in enumerate(system.molecule)) + "\n"
    )
    setup = (
        "units lj\natom_style atomic\nfix body all property/atom i_body ghost yes\n"
        "read_data data.bodies fix body NULL Members\n"
        f"pair_style soft 1.5\npair_coeff * * 20\nneighbor 0.2 bin\n{EACH_STEP}\n"
        "group bodies union all"
    )
    system = system._replace(setup=setup, files={"data.bodies": data})
    theirs = simulate(system, RIGID, 50, words="custom i_body")
    ours = simulate(system, LIKE_LAMMPS, 50, words="custom i_body", ranks=2)
    assert_same(ours, theirs, system.h)


# ---- several worlds

WORLDS = """{world}
{setup}
velocity all create 1.0 ${{seed}}
{fix}
thermo 5
run 20
write_dump all custom end.${{seed}} id x y z vx vy vz modify sort id format float %.16g
"""


def said_of_bodies(log):
    """What the log says of the bodies, and all thermo tables."""
    return re.findall(r"(?m)^Rigid bodies.*\n(?:  .*\n)+", log), read_thermo(log)


def test_partitions(run_lammps, tmp_path):
    """Locks out messages between ranks of different worlds, and a world whose log is another one's:
    each of two worlds moves to the last bit as it does alone."""
    system = mixture("solid planar")
    text = dict(setup=system.setup, fix=LIKE_LAMMPS.format(group="all", words="molecule"))
    run_lammps(
        WORLDS.format(world="variable seed world 4928 1234", **text),
        files=system.files,
        ranks=4,
        options=("-partition", "2x2"),
        launcher="lmp",
    )
    together = [(tmp_path / f"log.lammps.{k}").read_text() for k in (0, 1)]
    ends = [(tmp_path / f"end.{seed}").read_text() for seed in (4928, 1234)]
    assert ends[0] != ends[1]
    for seed, log, end in zip((4928, 1234), together, ends):
        alone = run_lammps(
            WORLDS.format(world="", **text),
            files=system.files,
            ranks=2,
            options=("-var", "seed", str(seed)),
        )
        assert (tmp_path / f"end.{seed}").read_text() == end
        bodies, thermo = said_of_bodies(log)
        assert len(bodies) == 1 and bodies == said_of_bodies(alone.log)[0]
        assert (thermo == alone.thermo).all() and len(thermo) == 5


NOISY = {
    "langevin": "nvt molecule temp 2 2 2e-1 seed 7",
    "csvr": "nvt molecule temp 2 2 2e-1 thermostat csvr seed 7",
    "crescale": "npt molecule temp 2 2 2e-1 thermostat nh seed 7 iso 1 1 2e-1 compressibility 1e-2",
    "hmc": "hmc molecule temp 2 steps 10 seed 7",
}
REPLICAS = """variable w {world}
log log.$w
{setup}
{fix}
run 20
{stop}
run 20
write_dump all custom end.$w id x y z vx vy vz modify sort id format float %.17g
"""


@pytest.mark.parametrize("scheme", NOISY)
def test_noise_of_worlds(run_lammps, tmp_path, scheme):
    """Locks out the same noise in all worlds of a partition that have one seed, which correlates
    replicas; and noise of a world that depends on how many ranks it has, or on a restart. The first
    world has the noise of a run without partitions."""
    system = mixture("solid", side=2, spacing=2.9)
    fix = f"timestep 0.01\nfix 1 all nosquish/{NOISY[scheme]}"
    restart = f"write_restart half.$w\nclear\nread_restart half.$w\n{AFTER}{fix}"

    def ends(world, *partition, stop=""):
        run_lammps(
            REPLICAS.format(world=world, setup=system.setup, fix=fix, stop=stop),
            files=system.files,
            ranks=sum(partition) or 1,
            options=("-partition", *map(str, partition)) if partition else (),
            launcher="lmp" if partition else None,
        )
        said = "each world of the partition has its own" in (tmp_path / "log.0").read_text()
        assert said == bool(partition)
        return [np.loadtxt(end, skiprows=9) for end in sorted(tmp_path.glob("end.*"))]

    (alone,) = ends("index 0")
    first, second = ends("world 0 1", 1, 1)
    np.testing.assert_array_equal(first, alone)
    assert np.abs(first - second).max() > 1e-3
    np.testing.assert_allclose(ends("world 0 1", 1, 2, stop=restart)[1], second, atol=1e-8)


# ---- few bodies, long bodies, large bodies


@pytest.mark.parametrize("others, grid", [(0, (2, 2, 2)), (60, (2, 2, 1))])
def test_more_ranks_than_bodies(simulate, others, grid):
    """Locks out a rank without bodies, or without any atom, that waits for the others or crashes:
    one body of three atoms, alone and among free atoms."""
    rng, h = np.random.default_rng(3), 9.0 * np.eye(3)
    body = [[4.4, 4.4, 4.4], [5.0, 4.4, 4.5], [4.4, 4.9, 4.3]]
    bodies = [("bent", np.array(body), np.array([1, 2, 3]))]
    for site in itertools.islice(itertools.product((1, 3, 7, 8.5), repeat=3), others):
        bodies.append(turned("single", site, bodies, h, rng))
    system = assemble(
        bodies, h, temperature=4.0, setup="processors {} {} {}".format(*grid)
    )._replace(group="bent", singles=others > 0)
    alone = system._replace(setup=re.sub("processors .*", "", system.setup))
    pull = "variable pull atom 3*(4.5-x)\nfix 3 all addforce v_pull 0 0"
    theirs = simulate(alone, RIGID, 20, before=pull)
    free = "\nfix 2 single nve" if others else ""
    ours = simulate(
        system,
        LIKE_LAMMPS + free,
        20,
        group="bent",
        before=f"{pull}\n{EACH_STEP}",
        ranks=int(np.prod(grid)),
    )
    assert_same(ours, theirs, system.h)


@pytest.mark.quick("2")
@pytest.mark.parametrize("ranks", [1, 2])
def test_body_of_many_atoms(simulate, ranks):
    """Locks out sums over a body's atoms that lose digits, and arrays too small for it: 100,000
    atoms, cut by the periodic faces and by the ranks, that a force turns."""
    setup = "\n".join(
        [
            "units lj",
            "atom_style atomic",
            "lattice sc 1.0",
            "region box block 0 100 0 100 0 100",
            "region body block 0 79 0 49 0 24",
            "create_box 2 box",
            "create_atoms 1 region body",
            "mass 1 1.0",
            "mass 2 2.5",
            "set type 1 type/fraction 2 0.3 4928",
            "displace_atoms all move 80.3 70.2 75.1",
            "velocity all create 50.0 4928 loop all",
            "velocity all ramp vx -4 4 y 0 100 sum yes",
            "pair_style zero 1.5",
            "pair_coeff * *",
            "neighbor 0.3 bin",
            "neigh_modify every 2 delay 0 check no",
            "variable pull atom (id%7)*(x-50)",
            "fix 5 all addforce v_pull 0 3",
        ]
    )
    system = System(setup, {}, 100.0 * np.eye(3), 0.02, group="all")
    theirs = simulate(system, RIGID, 8, words="single", every=4)
    ours = simulate(system, LIKE_LAMMPS, 8, words="single", every=4, ranks=ranks)
    assert len(ours.x) == 100_000 and "1 rigid bodies with 100000 atoms" in ours.log
    assert_same(ours, theirs, system.h)
