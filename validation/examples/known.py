"""Examples whose columns differ for a reason that is known, and the reason."""

_DOF = (
    "LAMMPS's thermostat counts the total momentum, which is zero, among the degrees of freedom, "
    "so its mean temperature is higher than the target"
)
_BOX = (
    "the run begins far from its pressure and ends before it is reached. LAMMPS's piston is pushed "
    "by the impulse in the pressure of step 0, and has another thermostat"
)
KNOWN = {
    "deposit/in.deposit.molecule.rigid-nvt-small": (
        "LAMMPS's fix has no thermostat for molecules that are inserted in the run, unless the "
        "script says fix_modify dynamic/dof yes. With that the two agree"
    ),
    "rigid/in.rigid.cubes.nvt": _DOF,
    "rigid/in.rigid.cubes.npt": _BOX,
    "rigid/in.rigid.cubes.nph": _BOX,
    "rigid/in.rigid.tnr": (
        "the first half step of LAMMPS's fix lacks the random forces of the fix langevin behind "
        f"it, and at constant pressure {_BOX}"
    ),
}
