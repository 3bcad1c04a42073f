"""How a run begins: from top to bottom."""

from collections.abc import Iterable
from math import gcd
from typing import Any

import numpy as np

from ..errors import refuse
from ..host.hosts import Phase
from . import cards
from .conditions import conditions_of, refuse_time_step
from .minimization import Minimization
from .other_fixes import refuse_constraints, refuse_other_integrators
from .output import BodyFile
from .passes import Passes
from .registry import refuse_shared_atoms
from .run import Run
from .schedule import LATE, LEVELS, LOOKS, MID_STEP, RESETS, SEEN, WATCHED
from .setting import Setting


def begin_run(setting: Setting, last: Run | None) -> Run:
    """Begin a run: look, make or keep the bodies, bind the passes, check, plan; collective.

    Args:
        last: the run before; None before the first one.
    Raises:
        RunError: if the run cannot be right.
    """
    lammps, host, integrator = setting.lammps, setting.host, setting.integrator
    command, membership, maker = setting.command, setting.membership, setting.maker
    if last:
        last.note_pending()
    refuse_time_step(lammps.dt, integrator.parts, command.line.name)
    host.set_schedule(None)
    host.phase = Phase.NEW
    host.set_bodies(None, None)  # the atoms are not those of the last run
    if maker.goes_on:
        membership.find_groups()
    else:
        maker.decide()
    conditions = conditions_of(setting)
    if conditions.goes_on and maker.made:
        made = maker.made
        made.bodies.bind(membership)
    else:
        made = maker.make(last.free if last else lambda: None)
    run = Run(setting, made, conditions)
    _bind(run)
    if not conditions.goes_on:
        _set_first_velocities(run)
    refuse_other_integrators(conditions.other_fixes, run.ours, membership, host)
    refuse_shared_atoms(conditions.siblings, setting.number, command.line, membership)
    refuse_constraints(conditions.other_fixes, run.ours, host)
    run.take_time_step()
    run.cards = cards.find(lammps, conditions.other_fixes.packages)
    run.cards.refuse(
        energy=setting.needs_energy, levels=conditions.levels, counts=bool(host.counts)
    )
    if command.output and not setting.table:
        setting.table = _open_table(command.output.file, run)
    _plan(run)
    run.report_count()
    if host.dmax:
        run.minimization = _begin_minimization(run)
    return run


def _bind(run: Run) -> None:
    """Bind the passes of the run to its bodies; collective."""
    integrator, external, bodies, setting = run.integrator, run.external, run.bodies, run.setting
    remaps = run.conditions.remaps_velocities
    external.begin(levels=run.conditions.levels)
    external.set_bodies(bodies)
    bodies.cells["rate"].set(run.host.rate if remaps else np.zeros(6))
    if (mask := run.mask) is not None:
        bodies.cells["mask"].set(mask)
    for part in integrator.parts:
        part.begin(run)
    declaring = integrator, *integrator.parts
    parameters = _joined(each.extra_parameters(run) for each in declaring)
    mrot = setting.maker.rotation.inner_steps
    setting.parameters = integrator.numbers(ftm2v=run.lammps.ftm2v, mrot=mrot, **parameters)
    run.passes = Passes(
        integrator, bodies, run.lammps, run.parameters, run.conditions,
        external.cells if external.present else None, run.host.orient_atom,
        _joined(each.extra_cells(run) for each in declaring),
        lambda cells: _joined(each.extra_lists(run, cells) for each in declaring),
    )  # fmt: skip


def _joined(dictionaries: Iterable[dict[str, Any]]) -> dict[str, Any]:
    return {name: value for some in dictionaries for name, value in some.items()}


def _set_first_velocities(run: Run) -> None:
    """Have the atoms move as the bodies that were made of them; collective."""
    remaps = run.conditions.remaps_velocities
    if remaps:  # velocities are those that bodies have where the box has them
        run.bodies.settle(run.lammps)
        run.velocities.take()
    run.passes.run("orient")
    run.set_velocities()
    # commands between runs set up a run, too, such as write_restart
    first, *_ = *run.host.command, "run"
    if remaps and not first.startswith(("run", "rerun", "temper")):
        run.velocities.set_in_body()


def _open_table(file: str, run: Run) -> BodyFile:
    """Open the file of keyword output; collective."""
    path = run.lammps.text(file)
    tables = (sibling.table for sibling in run.conditions.siblings)
    refuse(
        any(table and table.path == path for table in tables),
        f"two fixes write their table of bodies (keyword output) to {path}: "
        "give each a file of its own",
    )
    return BodyFile(path, run.ranks)


def _plan(run: Run) -> None:
    """Give the host the facts of this run, and have it follow the schedule."""
    conditions, host, pending = run.conditions, run.host, run.setting.pending_half_kick
    looks = run.box.may_change or run.masses_may_change or run.setting.rigid_flag
    facts = {
        SEEN: host.facts & SEEN,
        LATE: conditions.other_fixes.late,
        MID_STEP: conditions.mid_step,
        LEVELS: conditions.levels,
        WATCHED: run.box.may_change,
        LOOKS: looks or run.switches,
        RESETS: conditions.mid_step and pending not in (None, run.dt),
    }
    host.facts = sum(bit for bit, holds in facts.items() if holds)
    if host.facts & RESETS:
        run.passes.level_dt.set(pending)
    output = run.command.output
    host.set_schedule(
        run.passes.lists,
        velocities_every=gcd(*conditions.other_fixes.velocities_every),
        table_every=output.steps if output else 0,
    )


def _begin_minimization(run: Run) -> Minimization:
    """Declare the bodies' coordinates in a minimization to LAMMPS; collective."""
    host = run.host
    unknown = "minimize needs the energy of all forces, which does not include that of "
    refuse(
        run.conditions.gravity is not None,
        f"{unknown}keyword gravity: remove 'disable' from fix gravity and use 'fix_modify energy "
        "yes' instead",
    )
    refuse(
        run.external.present,
        f"{unknown}fix_modify external: use a run with fix nosquish/nvt at a low temperature",
    )
    refuse(
        any(fix.style.startswith("box/relax") for fix in run.conditions.other_fixes),
        "fix box/relax would deform the rigid bodies with the box: unfix it before minimize, and "
        "use fix nosquish/npt or fix nosquish/nph and a run for the box",
    )
    begun = Minimization(run.bodies, run.ranks, bool(run.switches))
    host.min_dof = 6 * len(begun.ids)
    host.log(
        f"Minimization: bodies stay rigid. LAMMPS's {host.min_dof} extra global DOFs are their "
        "coordinates, which add no energy\n"
    )
    return begun
