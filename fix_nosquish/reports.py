"""What LAMMPS and the user are told of the bodies: log, degrees of freedom, virial, thermo columns, table, restart file."""

import numpy as np

from . import infile, kernels, output, thermo
from .build import build
from .errors import RunError
from .hosts import OwnFix, hook


class Reports:
    """The part of an integrator that tells of its bodies; the integrator itself is derived from it.

    Attributes:
        vector_extensive, array_columns, array_rows: what the plugin announces of `compute_vector` and `compute_array`.
        restart_file: whether LAMMPS is to call `write_restart_file`.
    """

    vector_extensive = (True, True, False, False)
    array_columns = 15

    def _say(self, virial):
        """Log what the bodies are, if that has changed, and what was taken from the atoms' velocities."""
        lines, removed = thermo.summary(self, self._notes, virial)
        warnings = [line for line in thermo.warnings(self, self._notes) if line not in self._warned]
        self._warned.update(warnings)
        said, self._said = self._said, lines[:4]
        if not said or said[:3] != lines[:3]:
            advice = self.host.advice(removed) if isinstance(self.host, OwnFix) else ()
            self.host.log("\n".join([*lines, *advice, ""]))
        elif said[3] != lines[3] and thermo.projected(self._notes):
            self.host.log(lines[3] + "\n")
        if warnings:
            self.host.log("\n".join([*warnings, ""]))

    def _open(self):
        path = self.lammps.text(self.command.output[1])
        if any(mate._file and mate._file.path == path for mate in self._mates):
            raise RunError(
                f"two fixes write their table of bodies (keyword output) to {path}: give each a file of its own",
                everywhere=True,
            )
        if self.respa_dt is not None and isinstance(self.host, OwnFix):
            raise RunError(
                "keyword output needs the plugin's fix python/move under run_style respa: this LAMMPS's own knows no end of a step",
                everywhere=True,
            )
        return output.BodyFile(path, self.lammps.units, self.world)

    def _due(self):
        return (
            self._file
            and self.lammps.step % self.command.output[0] == 0
            and self._file.last != self.lammps.step
        )

    def _write(self):
        if self._due():
            self._file.write(self.lammps.step, output.table(self.bodies, self.lammps))

    def _constraint_virial(self, virial=None):
        virial = self.virial if virial is None else virial
        if virial is None:
            return
        bodies, of_atoms = self.bodies, self.virial_per_atom
        kernels.constraint_virial(bodies.state, *bodies.atoms, self.lammps.masses[bodies.index], self.lammps.ftm2v,
                                  self.lammps.per_atom("f", columns=3), virial,
                                  np.empty((0, 6)) if of_atoms is None else of_atoms, bodies.scratch)  # fmt: skip

    def _virial_of_all(self):
        """The virial of all bodies on all ranks, while LAMMPS is between its forces and final_integrate."""
        virial = np.zeros(6)
        for mate in self._mates:
            mate._add_virial(virial)
        return self.world.total(virial)

    def _add_virial(self, virial):
        if self._half and not self._vflag:
            return
        if self.host.atoms_moved() or not self._half:
            self.post_neighbor()
        self._gather()
        bodies = self.bodies
        p, v = bodies.p.copy(), bodies.v.copy()
        if self._half:
            self._kick(self.dt)
        self._constraint_virial(virial)
        bodies.p[:], bodies.v[:] = p, v

    @hook
    def dof(self, group):
        """Degrees of freedom that the bodies take from a group of atoms; collective.

        Args:
            group: LAMMPS's number of the group.
        """
        bodies = self.bodies
        between_runs = self._over or not self.lammps.running
        if between_runs and self.host.creates_velocities:
            return 0  # all atoms' velocities are scaled now; a body keeps its share of them when the run makes them rigid motion
        if (
            not self.lammps.running or bodies is None
        ):  # atoms may be other ones and elsewhere; the bodies of the last run stay as they are
            former = self._former()
            bodies = build(self.lammps, self.world, self.membership, self._infile, former=former)[0]
        inside = self.lammps.groups[bodies.index] & (1 << group) != 0
        return thermo.removed_freedom(bodies, self.world, inside, self.lammps)

    def _energies(self):
        self._see_changed_velocities()
        return self._once(
            "energies", lambda bodies: thermo.energies(bodies, self.world, self.lammps)
        )

    def _once(self, name, make):
        """What make(bodies) returned, if nothing has changed the bodies since it was called in this step."""
        bodies = self._made()  # which may change them
        if self._known.get("step") != self.lammps.step:
            self._known = {"step": self.lammps.step}
        if name not in self._known:
            self._known[name] = make(bodies)
        return self._known[name]

    def _see_changed_velocities(self):
        if self.lammps.running and self._settled and not self._half:
            self._take_changed_velocities(self.lammps.step)

    @hook
    def compute_scalar(self):
        """Temperature of the bodies; as fix rigid's, but of all components, whether force and torque act on them or not; collective."""
        return self._energies()[4]

    @hook
    def compute_vector(self, i):
        """Kinetic energy of translation and of rotation, temperature of translation and of rotation; collective."""
        return self._energies()[i]

    @hook
    def compute_array(self, i, j):
        """Value j of body i: see `output.global_array`; collective."""
        self._see_changed_velocities()
        return self._once(
            "array",
            lambda bodies: output.global_array(
                self.world.gather_to_all(output.table(bodies, self.lammps))
            ),
        )[i, j]

    @hook
    def write_restart_file(self, name):
        """LAMMPS writes a restart file: keep the bodies of an infile beside it, to be read as infile; collective."""
        infile.write(name + ".rigid", self._made(), self.lammps, self.world)

    def table(self):
        """The bodies that are counted on this rank as they are now: see `output.table`."""
        return output.table(self._made(), self.lammps)

    def _made(self):
        if self.bodies is None:
            raise RunError(
                "there is nothing to tell of the bodies before the first run: 'run 0' makes them",
                everywhere=True,
            )
        self._catch_up()
        return self.bodies
