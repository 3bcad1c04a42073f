"""What is done at each hook of a step, in order: the same in every run.

LAMMPS calls the fix at its hooks.  At each of them the actions of `SCHEDULE` that apply are done,
one after the other, each in the phase that those before it have set: an action runs a list of
passes (see `passes`), or calls a method of the `run.Run`, and names the next phase.  Nothing else
sets the phase.

The plugin follows the schedule in C++, and calls Python only for an action that needs it.
`perform` does the same in Python: for hooks that are not in each step, and for LAMMPS's own fix
python/move.
Between hooks LAMMPS moves atoms to their ranks, builds neighbor lists, and computes forces.

A step with a thermostat, on several ranks:

    begin     list "whole": `gather` sums the forces of the last step on this rank's atoms of shared
              bodies, and `give` sends the sums, six numbers a body.  Meanwhile `advance` moves the
              bodies that are not shared: it ends the last step (letter B) and begins this one (B A
              O A).  `combine` receives the sums and adds them in the order of the ranks, and
              `advance` moves the shared bodies, on each rank that has one.  `prepares` comes before
              `advance`; a thermostat that needs a sum over all bodies has it between two passes, of
              which the second is `go_on`.
    neighbor  list "follow", if LAMMPS has re-neighbored: atoms that have come brought a copy of
              their body (`plugin/exchange.h`), and the ranks ask who shares what
              (`ranks.sharing.find`).  Two sums over all ranks.
    end       nothing, or list "velocities" if something reads them.  If LAMMPS asks for the virial,
              list "constraint_virial" sums and exchanges the new forces, which "whole" does again.
"""

from collections.abc import Callable
from typing import NamedTuple

from ..host.hosts import Host, Phase
from ..structs import When
from .passes import Passes

SEEN, LATE, MID_STEP, LEVELS = When.SEEN, When.LATE, When.MID_STEP, When.LEVELS
WATCHED, LOOKS, RESETS, GATHERS = When.WATCHED, When.LOOKS, When.RESETS, When.GATHERS
CALLED, SHOWN, VIRIAL, TABLE = When.CALLED, When.SHOWN, When.VIRIAL_ASKED, When.TABLE
ENERGY, MOVES_BOX = When.ENERGY, When.MOVES_BOX
PRESSURE, OTHER_BOX = When.PRESSURE, When.OTHER_BOX
NEW, SET, HALF, WAITING, OVER = Phase
ANY = tuple(Phase)
BEGUN = tuple(phase for phase in Phase if phase != NEW)


class Action(NamedTuple):
    """One thing that is done at a hook.

    Attributes:
        hook: its name.
        phases: the phases in which it applies.
        when, unless: bits of `When` that must all be set, and of which none may be.
        passes: the list of passes that it runs.
        call: the method of the `run.Run` that it calls; with passes only if one of these fails,
            where `raise_failure` is called if there is no such method.
        then: the next phase; None if it stays.
        sets, clears: bits of `When` that are set and cleared from now on.
    """

    hook: str
    phases: tuple[Phase, ...]
    when: When = When(0)
    unless: When = When(0)
    passes: str | None = None
    call: str | None = None
    then: Phase | None = None
    sets: When = When(0)
    clears: When = When(0)


A = Action
ACTIONS = (
    # the run's first forces are known
    A("setup", ANY, call="start"),
    A("setup", ANY, when=MID_STEP, then=WAITING),
    A("setup", ANY, unless=MID_STEP, then=SET),
    A("setup", ANY, when=VIRIAL, passes="constraint_virial"),
    A("setup", ANY, when=PRESSURE, passes="pressure"),
    A("setup", ANY, call="report_start"),
    A("setup", ANY, when=TABLE, call="write_table"),
    # initial_integrate: the first half of a step
    A("begin", (WAITING, SET), when=LATE | SEEN, call="take_late_velocities"),
    # a run with 'pre no' is not set up, also after a command that has only begun one
    A("begin", (NEW,), call="set_up"),
    A("begin", (OVER,), call="continue_"),
    A("begin", (OVER,), when=MID_STEP, then=WAITING),
    A("begin", (OVER,), then=SET),
    A("begin", (WAITING,), when=RESETS, passes="close", then=SET, clears=SEEN),
    A("begin", ANY, when=RESETS, call="take_time_step", clears=RESETS),
    A("begin", ANY, when=GATHERS, unless=LEVELS, passes="gather", clears=GATHERS),
    A("begin", ANY, when=CALLED, call="begin_trajectory"),
    A("begin", (WAITING,), unless=LEVELS, passes="whole", then=HALF, clears=SEEN),
    A("begin", (SET,), unless=LEVELS, passes="begin", then=HALF, clears=SEEN),
    A("begin", (HALF,), when=MOVES_BOX, passes="cell"),
    # with run_style respa the innermost level moves the bodies, when all others have kicked them
    A("move", ANY, passes="begin", then=HALF, clears=SEEN),
    # LAMMPS exchanges atoms and rebuilds its lists: before it, and after it.  Another box ends the
    # run, if it is not the bodies' own: see `other_boxes`
    A("exchange", ANY, passes="flip"),
    A("neighbor", ANY, when=OTHER_BOX, call="follow_atoms"),
    A("neighbor", ANY, when=LOOKS, unless=OTHER_BOX, call="follow_atoms"),
    A("neighbor", ANY, unless=LOOKS | OTHER_BOX, passes="follow", call="follow_atoms"),
    # another fix has changed the box, or taken other vectors of the same lattice for it
    A("deform", ANY, passes="deform"),
    A("flipped", ANY, passes="flipped", call="follow_atoms"),
    # final_integrate: the second half of a step.  With MID_STEP it is always left to the next one
    # (list "whole"), else if nothing reads it
    A("end", (HALF,), when=WATCHED, call="refuse_new_box"),
    A("end", (HALF,), when=MID_STEP, then=WAITING),
    A("end", (HALF,), unless=SHOWN | VIRIAL | TABLE | ENERGY, then=WAITING),
    A("end", (HALF,), passes="close", then=SET),
    A("end", ANY, when=ENERGY, call="take_energy"),
    A("end", ANY, when=SHOWN, passes="velocities", sets=SEEN),
    A("end", ANY, when=VIRIAL, passes="constraint_virial"),
    A("end", ANY, when=PRESSURE, passes="pressure"),
    A("end", ANY, when=TABLE, call="write_table"),
    # end_of_step, with run_style respa only
    A("end_levels", (HALF,), then=SET, sets=SEEN),
    A("end_levels", ANY, when=VIRIAL, passes="gather"),
    A("end_levels", ANY, when=VIRIAL, passes="constraint_virial"),
    A("end_levels", ANY, when=TABLE, unless=VIRIAL, passes="gather"),
    A("end_levels", ANY, when=TABLE, call="write_table"),
    # the bodies as at the end of a step with output; their forces, too
    A("complete", (WAITING,), unless=MID_STEP, passes="close", then=SET, clears=SEEN),
    A("know_forces", (WAITING,), when=MID_STEP, passes="gather"),
    # the time step may be another one.  In the middle of a step it is that of the next one: the
    # last step's end has the old one
    A("reset_dt", (WAITING, OVER), when=MID_STEP, sets=RESETS),
    A("reset_dt", (WAITING,), unless=MID_STEP, passes="close", then=SET, clears=SEEN),
    A("reset_dt", (NEW, SET, HALF), call="take_time_step"),
    A("reset_dt", (OVER,), unless=MID_STEP, call="take_time_step"),
    # post_run
    A("post_run", BEGUN, call="end", then=OVER),
)
# the actions of each hook, with their numbers
SCHEDULE = {
    hook: tuple((number, action) for number, action in enumerate(ACTIONS) if action.hook == hook)
    for hook in dict.fromkeys(action.hook for action in ACTIONS)
}


def perform(hook: str, host: Host, passes: Passes, act: Callable[[int, int], None]) -> None:
    """Do what the schedule has for a hook, in Python; the plugin's `perform` does the same.

    Args:
        act: does what the action of a number has for Python, as `run.Run.act`.
    """
    now = host.now()
    for number, action in SCHEDULE[hook]:
        if host.phase not in action.phases or action.when & ~now or action.unless & now:
            continue
        if action.passes and action.passes not in passes.lists:
            continue  # this run has no such list
        code = passes.run(action.passes) if action.passes else 0
        if code or (action.call and not action.passes):
            act(number, code)
        if action.then is not None:
            host.phase = action.then
        host.facts = (host.facts | action.sets) & ~action.clears
