"""What an integrator says of its step; loops, memory and messages follow from it."""

from collections.abc import Callable
from typing import ClassVar

from ..loops.compiled import Kind, Loop
from ..motion import step
from ..motion.operations import Parameters

_OF_LOOPS = "splitting", "operations", "numbers", "rows", "starts"


class Declaration:
    """What a class derived from `integrator.Integrator` may declare, and what holds if it does not.

    The step:
        splitting, operations: what a step is; see `step.stages`.
        numbers: the record of the parameters that its operations take: `operations.Parameters`, or
            one that extends it.
        rows: how many numbers of its own each body has; they go where the body goes, and begin as
            0. In a block they are the rows from BLOCK_ROWS on.
        kept: how many more numbers go where the body goes, behind its rows in the state, which
            operations do not see.
        work: how many more rows of a block its operations need to work with.
        starts: what sets its own rows when the forces of the start are known, or None: a function
            as in an operation, inlined.
        prepares: a loop that sets parameters for the letter that is `prepared`, or None; it returns
            0, or -1 to end the run with the message `unprepared`.
        middle: whether the velocities that atoms have at the end of a step are those of its middle,
            before the letters behind the forces: with a thermostat there, these are the right ones.
            Not with run_style respa.

    What it can do:
        method: what the log calls it.
        splits: whether it has use for the keywords mrot and order.  Keyword rotor exact is for
            those with an operation that says so.
        keywords: those of its own, besides what `command.KEYWORDS` has for all.
        respa: whether it can have the forces of the levels of run_style respa.
        thermostat: whether it keeps a temperature, so that no other fix may.
        quenches: whether it ends a run by itself.
        backwards: whether the time step may be below zero, so that a run goes back in time.
        crosses: whether bodies may get another velocity where they cross a face, as with remap v of
            fix deform. A class with operations of its own says so anew.
        needs_energy: whether it needs the potential energy at the end of steps that it names, as
            host.energy_step.  Then it has a method take_energy for these, which names the next one
            and says whether the state stays; if not, `renewed` is called when the forces are known
            where it goes back to.
        couples: whether its scalar is an energy that it took from the system, which LAMMPS's
            econserve counts.
        restart_state: (n,) what a restart file keeps, or None: made in __init__, and never replaced
            by another array. The first number, above 0, says what the others are. It is -1 if the
            file has another one there, and the others stay as they were made.
        freedom_said: what the log says of the degrees of freedom that its thermostat acts on.
        own_warnings: lines for the log on what is probably not meant.
        modules: names of modules whose loops it needs, besides those of its classes.

    The box:
        every: it changes in the steps after the multiples of this; 0 for never.
        cell_loops: with `every`, a method that binds two lists of loops to cells: what the forces
            say of the pressure, and what changes the box in the next step.
        flips: whether tilts of the box change, so that it may take other vectors of its lattice.
        flip_loops: with `flips`, a method that binds the list of loops that do so, before atoms go
            to other ranks.

    Loops of the splitting:
        advance, go_on: the passes of a step.
        kick: that of a level of run_style respa.
        start: of `starts`.
    """

    operations: ClassVar[dict] = {}
    numbers: Kind = Parameters
    splitting, rows, kept, work = "", 0, 0, 0
    starts: Callable | None = None
    prepares: Loop | None = None
    unprepared, middle = "", False
    advance: Loop
    go_on: Loop | None
    kick: Loop
    start: Loop | None

    method, splits, keywords, respa, thermostat = "", False, (), True, False
    quenches = crosses = needs_energy = couples = False
    backwards = True
    restart_state, freedom_said = None, ""
    own_warnings, modules = (), ()
    every, flips = 0, False

    def __init_subclass__(cls):
        if cls.splitting and not vars(cls).keys().isdisjoint(_OF_LOOPS):
            cls.advance, cls.go_on, cls.kick = step.make_loops(cls)
            cls.start = cls.starts and step.make_start(cls)
            cls.crosses = vars(cls).get("crosses", False)  # of each motion by itself

    def own_parameters(self):
        """Its parameters, besides those of `operations`: a dictionary from fields of `numbers`;
        asked when a run begins.  Fields that it does not name are 0."""
        return {}

    def own_cells(self):
        """A dictionary of the cells that its own loops take."""
        return {}

    def own_lists(self, cells):
        """Lists of loops of its own, by name, bound to cells."""
        return {}

    def loops_behind(self, cells):
        """A list of loops that come behind the second pass over the bodies, bound to cells."""
        return []

    def turned_over(self):
        """There are other bodies than before, in a run; collective."""

    def resumed(self):
        """A run's first step begins without a setup before it; collective.

        So it is with 'pre no', and always with a LAMMPS's own fix.
        """

    def write_restart(self):
        """LAMMPS writes a restart file: have `restart_state` ready for it; collective."""

    def begin_trajectory(self):
        """The step ``host.begins`` is about to begin; collective."""

    def complaint(self, found):
        """Why a loop that returned a number below 0 ends the run."""
        return self.unprepared
