"""Build a start of any number of molecules, from 512 on: a cube cut out of copies of data.water.

    python cut_water.py 10648 data.water-10648
    mpirun -np 2 python cut_water.py 10648 data.water-10648

(A whole number of copies needs no cut: LAMMPS's `replicate 4 5 5` makes 100,000.)
The molecules nearest to a corner of the stacked copies are kept, in the cube that has 1 g/cm^3.
Its opposite faces did not belong together: molecules that meet there are pushed apart by a soft
repulsion, slide into the nearest valley of the real forces, and 1 ps of Langevin
dynamics at 295 K heals the seam.  In the end velocities are scaled to 295 K, as build_water.py
does.  10,648 molecules take some minutes.  Needs numpy and the lammps module.
"""

import sys
from pathlib import Path

import numpy as np
from build_water import OUTPUT as WATER
from build_water import (
    SEED,
    TEMPERATURE,
    centre,
    gather,
    lammps,
    load,
    make_rigid,
    make_velocities_rigid,
    run,
    side,
    temperature,
    write_data,
)

LEAST = 512  # molecules; fewer would meet their own images, within cutoff and skin


def cut(positions, velocities, molecules):
    """The so many molecules nearest to the corner of stacked copies: (molecules, 3, 3) both."""
    box = side(len(positions))
    positions = positions - box * np.floor(centre(positions) / box)[:, None]
    copies = int(np.ceil((molecules / len(positions)) ** (1 / 3)))
    shifts = box * np.stack(np.meshgrid(*[np.arange(copies)] * 3, indexing="ij"), -1).reshape(
        -1, 1, 1, 3
    )
    stacked = (positions + shifts).reshape(-1, 3, 3)
    nearest = np.sort(np.argsort(centre(stacked).max(axis=1), kind="stable")[:molecules])
    return stacked[nearest], np.tile(velocities, (len(shifts), 1, 1))[nearest]


def main():
    molecules, output = int(sys.argv[1]), Path(sys.argv[2])
    start = output.with_name(output.name + ".start")
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    root = lmp.extract_setting("world_rank") == 0

    def begin(x, v):
        """LAMMPS with the force field and these molecules, (molecules, 3, 3) both."""
        if root:
            write_data(start, x, v)
        lmp.command("clear")  # waits for the file: all ranks
        load(lmp, start)

    load(lmp, WATER)
    if molecules < LEAST:
        raise SystemExit(f"at least {LEAST} molecules are needed")
    positions, velocities = cut(*gather(lmp), molecules)

    begin(positions, np.zeros_like(positions))
    lmp.commands_string("""
        kspace_style none
        pair_style soft 2.7
        pair_coeff 1 1 20.0 2.7
        pair_coeff * 2 20.0 1.8
        fix slow all viscous 300.0
        fix move all rigid/nve/small molecule
        timestep 1.0
        run 300
    """)
    positions, _ = gather(lmp)

    begin(positions, np.zeros_like(positions))
    lmp.commands_string("""
        fix slow all viscous 300.0
        fix move all rigid/nve/small molecule
        timestep 0.5
        run 100
    """)
    positions, _ = gather(lmp)

    begin(make_rigid(positions), make_velocities_rigid(positions, velocities))
    lmp.commands_string(f"""
        fix move all rigid/nve/small molecule
        fix bath all langevin {TEMPERATURE} {TEMPERATURE} 200 {SEED}
        timestep 2.0
    """)
    energy, kelvin, _ = run(lmp, 1.0)
    positions, velocities = gather(lmp)
    positions = make_rigid(positions)
    velocities = make_velocities_rigid(positions, velocities)
    velocities *= np.sqrt(TEMPERATURE / temperature(lmp, velocities))
    if root:
        start.unlink()
        write_data(output, positions, velocities)
        print(
            f"mean temperature while it healed {kelvin:.0f} K, "
            f"potential energy {energy / molecules:.3f} kcal/mol per molecule"
        )


if __name__ == "__main__":
    main()
