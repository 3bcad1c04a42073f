"""Wrong inputs, and what the message of each must say."""

from typing import NamedTuple

# 27 bodies of three atoms; what a case adds goes before the fix, and after it
SCRIPT = """
units         lj
atom_style    {atom_style}
atom_modify   map yes
boundary      {boundary}
lattice       sc 0.04
region        box block 0 3 0 3 0 3
region        inner block 0.5 2.5 0.5 2.5 0.5 2.5
create_box    1 box
molecule      bent mol.bent
create_atoms  {create}
mass          * 1.0
velocity      all create 1.0 4928
pair_style    lj/cut 2.5
pair_coeff    * * 1.0 0.4
neigh_modify  delay 0 every 1 check yes
timestep      0.001
thermo        5
{before}
fix           1 all python/move "{target}"
{after}
run           {steps}
"""


class Case(NamedTuple):
    """One wrong input: the words of the fix line, lines before and after it,
    what the message must say."""

    words: str = "all molecule"
    expected: tuple = ()
    before: str = ""
    after: str = ""
    module: str = "fix_nosquish.NVE"
    atom_style: str = "molecular"
    create: str = "0 box mol bent 4928"
    boundary: str = "p p p"
    steps: int = 100

    @property
    def script(self):
        target = f"{self.module} {self.words}".strip()
        return SCRIPT.format(
            target=target,
            **{k: v for k, v in self._asdict().items() if k not in ("words", "module")},
        )


SPLIT = "group one molecule 1\ngroup rest subtract all one\n"
DYNAMIC = "variable near atom x<4\ngroup some dynamic all var near every 5\n"
STATIC = ("group 'some' is dynamic", "group some static")
CASES = {
    # the words of the fix line
    "group that is not defined": Case(
        "nowhere molecule", ("group 'nowhere'", "define it before the fix")
    ),
    "body style that does not exist": Case(
        "all molecules", ("unknown body style 'molecules'", "single, molecule, custom")
    ),
    "keyword that does not exist": Case(
        "all molecule mrots 1", ("unknown keyword 'mrots'", "expected mrot")
    ),
    "no words at all": Case("", ("ends where", "ID of a group", "body style", "fix_nosquish.NVE")),
    "no body style": Case("all", ("body style", "ends where", "fix_nosquish.NVE all")),
    "value missing": Case("all molecule mrot", ("ends where", "number of inner rotor steps")),
    "value with a point": Case("all molecule mrot 2.5", ("'2.5'", "whole number of at least 1")),
    "keyword of fix rigid before a point": Case(
        "all molecule langevin 0.45 0.45 0.5 1",
        ("unknown keyword 'langevin'", "Langevin's thermostat"),
    ),
    "thermostat before a point": Case(
        "all molecule mrot 2 temp 1.4 1.4 10", ("unknown keyword 'temp'", "has no thermostat")
    ),
    "barostat before a point": Case(
        "all molecule iso 0.5 0.5 1", ("unknown keyword 'iso'", "has no barostat")
    ),
    "integrator before a point": Case(
        "all molecule mrot 2.5", ("integrator 'NVTT'",), module="fix_nosquish.NVTT"
    ),
    "no text at all": Case("", ("after python/move is empty", "GROUP BODYSTYLE"), module=""),
    "letters beyond ASCII": Case(
        "all molecule infile caf\u00e9", ("has letters beyond ASCII", "-var FILE name, and v_FILE")
    ),
    "letters beyond ASCII in a group": Case(
        "\u00e9t\u00e9 molecule",
        ("has letters beyond ASCII",),
        before="group \u00e9t\u00e9 union all",
    ),
    "letters beyond ASCII in a variable": Case(
        "all molecule infile v_f",
        ("of variable f has letters beyond ASCII", "lmp -var f VALUE"),
        before="variable f string caf\u00e9",
    ),
    "inner steps without end": Case(
        "all molecule mrot 1000000000000", ("at most 1000", "rotor exact is the limit of many")
    ),
    "chain without end": Case(
        "all molecule temp 1 1 1 thermostat nh tchain 100000000",
        ("at most 1000", "change nothing"),
        module="fix_nosquish.NVT",
    ),
    "chains that are too fast": Case(
        "all molecule temp 1 1 1e-5 thermostat nh",
        ("chains are unstable at step 1", "TDAMP 1e-05 is 0.01 time steps", "at least 0.02"),
        module="fix_nosquish.NVT",
    ),
    "time step below zero": Case(
        "all molecule temp 1 1 1 seed 5",
        ("the time step is -0.001", "NVT needs one above zero"),
        before="timestep -0.001",
        module="fix_nosquish.NVT",
    ),
    "time step below zero between": Case(
        "all molecule iso 1 1 1",
        ("the time step is -0.001", "NPH needs one above zero"),
        after="timestep -0.001",
        module="fix_nosquish.NPH",
    ),
    "time step of zero": Case(
        "all molecule iso 1 1 1",
        ("the time step is 0,",),
        after="timestep 0",
        module="fix_nosquish.NPH",
    ),
    "moments of nearly nothing": Case(
        "all molecule temp 1 1 1 seed 5 moments equal 1e-300",
        ("moments equal 1e-300", "more than half a turn in a step", "moments step"),
        module="fix_nosquish.NVT",
    ),
    "velocities that are too large": Case(
        "all molecule temp 1 1 1 thermostat csvr seed 5",
        ("velocities of the bodies' atoms are too large", "not finite"),
        before="velocity all set 1e200 0 0",
        module="fix_nosquish.NVT",
    ),
    "variable in the quotes": Case(
        "all molecule mrot ${n}",
        ("inside quotes: '${n}'", "without quotes", "v_n"),
        before="variable n equal 2",
    ),
    "variable before a point": Case(
        "all molecule infile ${f}.txt",
        ("variables inside quotes: '${f}.txt'",),
    ),
    "value not a number": Case("all molecule mrot two", ("'two'", "whole number of at least 1")),
    "value of zero": Case("all molecule mrot 0", ("'0'", "whole number of at least 1")),
    "keyword given twice": Case("all molecule mrot 2 mrot 3", ("mrot", "twice")),
    "inner steps of an exact rotation": Case(
        "all molecule rotor exact mrot 2", ("keyword mrot", "rotor exact splits none", "leave one")
    ),
    "order of an exact rotation": Case(
        "all molecule order 321 rotor exact", ("keyword order", "rotor exact splits none")
    ),
    "rotation of neither kind": Case(
        "all molecule rotor good", ("'good'", "exact", "or split (into rotations")
    ),
    "number of groups missing": Case("all group all", ("'all'", "number of groups")),
    "fewer groups than announced": Case("all group 2 all", ("ID of group 2 of 2",)),
    "body group that is not defined": Case("all group 1 nowhere", ("group 'nowhere'", "define it")),
    "one group as two bodies": Case("all group 2 all all", ("named twice",)),
    "custom of neither kind": Case("all custom d_mass", ("'d_mass'", "i_NAME", "v_NAME")),
    "property that is not defined": Case("all custom i_body", ("i_body", "fix property/atom")),
    "variable that is not defined": Case(
        "all custom v_body", ("variable 'body'", "define it before the fix")
    ),
    "variable that is not atom-style": Case(
        "all custom v_body",
        ("variable body", "not an atom-style", "variable body atom"),
        before="variable body equal 1",
    ),
    "integrator that does not exist": Case(
        "water molecule", ("integrator 'NVTT'", "expected one of NVE"), module="fix_nosquish.NVTT"
    ),
    "integrator without words": Case(
        "", ("integrator 'NVTT'", "expected one of NVE"), module="fix_nosquish.NVTT"
    ),
    "variable too large": Case(
        "all custom v_body",
        ("v_body", "too large an ID", "2^52"),
        before="variable body atom 1e20*(id-9)",
    ),
    # the atoms
    "atoms without IDs": Case(
        "some single flexible loose",
        ("needs atom IDs", "atom_modify id no"),
        before="clear\natom_style atomic\natom_modify id no\nregion r block 0 9 0 9 0 9\n"
        "create_box 1 r\ncreate_atoms 1 random 20 5 NULL\nmass 1 1\npair_style zero 2\n"
        "pair_coeff * *\ngroup some empty\ngroup loose union all",
    ),
    "bodies of a dynamic group": Case("some molecule", STATIC, before=DYNAMIC),
    "body that is a dynamic group": Case("all group 1 some", STATIC, before=DYNAMIC),
    "flexible atoms of a dynamic group": Case(
        "one molecule flexible some",
        STATIC,
        before=SPLIT + "variable near atom x<4\ngroup some dynamic rest var near every 5",
    ),
    "group that becomes dynamic": Case(
        "some molecule", STATIC, before="group some molecule 1", after="run 2\n" + DYNAMIC
    ),
    "box takes along a dynamic group": Case(
        "one molecule temp 1 1 1 seed 5 iso 1 1 10 compressibility 1 dilate some",
        STATIC,
        module="fix_nosquish.NPT",
        before=SPLIT + DYNAMIC + "fix own rest nve",
    ),
    "new molecule with the ID of a body": Case(
        expected=("came into the body of molecule 27", "given another ID", "unfix this fix"),
        after="run 2\nset atom 79 mol 1\ncreate_atoms 0 single 0.5 0.5 0.5 mol bent 77\n"
        "set atom 82*84 mol 27",
    ),
    "group without atoms": Case(
        "none molecule", ("no atom", "group 'none'", "fill the group"), before="group none empty"
    ),
    "atom style without molecules": Case(
        "all molecule",
        ("molecule-ID", "atom_style molecular or full"),
        atom_style="atomic",
        create="1 box",
    ),
    "atom in two bodies": Case(
        "all group 2 a b",
        ("atom 5", "groups a and b", "without common atoms"),
        before="group a id 1:5\ngroup b id 5:9",
    ),
    "body without mass": Case(
        "all molecule",
        ("body of molecule 1 ", "mass 0", "above zero"),
        before='fix 0 all python/move "spoil.NoMass"',
    ),
    "negative mass": Case(
        "all molecule",
        ("atom 1 ", "mass -1", "above zero"),
        before='fix 0 all python/move "spoil.NegativeMass"',
    ),
    "atoms at one point": Case(
        "all molecule",
        ("body of molecule 2 ", "mass of its 3 atoms at one point", "move them apart"),
        before="set atom 4*6 x 1.0 y 1.0 z 1.0",
    ),
    # other fixes
    "two fixes claim an atom": Case(
        "all molecule",
        ("atom 1 ", "two fixes", "mrot 2", "without common atoms"),
        after='fix 2 all python/move "fix_nosquish.NVE all molecule mrot 2"',
    ),
    "fix nve before ours": Case(
        "all molecule",
        ("atom", "molecule", "fix other", "nve", "without the bodies' atoms"),
        before="fix other all nve",
    ),
    "fix nve after ours": Case(
        "all molecule",
        ("atom", "molecule", "fix other", "nve", "without the bodies' atoms"),
        after="fix other all nve",
    ),
    "box changed by a barostat": Case(
        "one molecule",
        ("fix 2 (style npt) changes the box", "use fix_nosquish.NPT or fix_nosquish.NPH"),
        before=SPLIT,
        after="fix 2 rest npt temp 1 1 1 iso 1 1 1",
    ),
    "box deformed alone": Case(
        "all molecule",
        ("box has changed by step", "remap x (with fix_nosquish.NVE also v)", "between runs"),
        before="neigh_modify every 1 delay 0 check no",
        after="fix 2 all deform 1 x erate 0.01 remap none",
    ),
    "box deformed with respa": Case(
        "all molecule",
        ("box has changed by step 2", "remap x", "run_style verlet"),
        before="run_style respa 2 2 pair 2",
        after="fix 2 all deform 1 x erate 0.01",
    ),
    "minimization atom by atom": Case(
        "all molecule",
        ("min_style fire would move the atoms", "use 'min_style cg' or 'min_style sd'"),
        after="min_style fire\nminimize 0 0 10 10",
    ),
    "minimization of another part of the forces": Case(
        "all molecule",
        ("norm max leaves out two thirds", "'norm two' or 'norm inf'"),
        after="min_modify norm max\nminimize 0 0 10 10",
    ),
    "minimization without a step": Case(
        "all molecule",
        ("dmax must be above zero",),
        after="min_modify dmax 0\nminimize 0 0 10 10",
    ),
    "minimization with the box": Case(
        "all molecule",
        ("fix box/relax would deform", "use fix_nosquish.NPT or fix_nosquish.NPH"),
        after="fix 2 all box/relax iso 0.0\nminimize 0 0 10 10",
    ),
    "minimization with an unknown energy": Case(
        "all molecule",
        ("needs the energy of all forces", "a run with fix_nosquish.NVT"),
        after="fix_modify 1 external force 1 0 0\nminimize 0 0 10 10",
    ),
    "no forces after a minimization": Case(
        "all molecule",
        ("'run N pre no' cannot follow a minimization", "'run N pre yes'"),
        after="minimize 0 0 2 10\nwrite_data data.end\nrun 5 pre no",
    ),
    # in mid-run
    "force not finite from the start": Case(
        "all molecule",
        ("force on the body of molecule 2 ", "not finite at step 0", "overlap"),
        before="neigh_modify exclude molecule/intra all\nset atom 4 x 1.0 y 1.0 z 1.0\n"
        "set atom 5 x 1.6 y 1.0 z 1.0\n"
        "set atom 6 x 1.0 y 1.4 z 1.0\nset atom 7 x 1.0 y 0.6 z 1.0\nset atom 8 x 1.6 y 0.6 z 1.0\n"
        "set atom 9 x 1.0 y 1.0 z 1.0",
    ),
    "force that becomes infinite": Case(
        "all molecule",
        ("force on the body of molecule 3 ", "not finite at step 4", "shorter time step"),
        before="variable f equal exp(800*(step>3))-1\ngroup g id 7",
        after="fix 2 g addforce v_f 0 0",
    ),
    "force that becomes NaN": Case(
        "all molecule",
        ("force on the body of molecule 3 ", "not finite at step 4"),
        before="variable f equal exp(200*step)-exp(200*step)\ngroup g id 7",
        after="fix 2 g addforce v_f 0 0",
    ),
    "run that explodes": Case(
        "all molecule",
        (
            "the time step is too long: a body moves by",
            "rad in it, and atom",
            "of the body of molecule 1 ",
            "by step 1: use a shorter one",
        ),
        before="timestep 10\nvelocity all scale 100",
    ),
    "time step too long for the forces": Case(
        "all molecule",
        ("the time step is too long", "is gone by step", "shorter"),
        before="timestep 0.7",
        steps=10000,
    ),
    "overlap at the start": Case(
        "all molecule",
        (
            "atoms overlap at the start, or the time step is too long: "
            "the force on the body of molecule 2",
            "moves it by",
            "in the first step, and atom",
            "is gone by step 1",
            "relax the bodies with minimize while this fix is defined",
        ),
        before="neigh_modify exclude molecule/intra all\nset atom 4 x 1.001 y 1.0 z 1.0\n"
        "set atom 5 x 1.601 y 1.0 z 1.0\nset atom 6 x 1.001 y 1.4 z 1.0\n"
        "set atom 7 x 1.0 y 0.6 z 1.0\nset atom 8 x 1.6 y 0.6 z 1.0\nset atom 9 x 1.0 y 1.0 z 1.0",
    ),
    "atoms lost": Case(
        "all molecule",
        ("of the body of molecule ", "is gone by step", "thermo_modify lost"),
        boundary="f f f",
        create="0 region inner mol bent 4928",
        before="thermo_modify lost ignore\nvelocity all scale 5000\nvelocity all zero angular",
        steps=1000,
    ),
    "atoms deleted by a fix": Case(
        "all molecule",
        ("of the body of molecule ", "is gone by step 5", "delete whole molecules"),
        after="fix 2 all evaporate 5 1 box 4928",
    ),
    "atoms added by a fix": Case(
        "all molecule",
        ("atom 83 came into the body of molecule 0 by step 6", "has its atoms", "whole bodies"),
        after="fix 2 all deposit 2 1 5 4928 region box near 0.5",
    ),
    "exception of its own": Case("", ("ValueError: no such luck",), module="spoil.BreaksOnOneRank"),
}
