/* Fixes nosquish/nve, /nvt, ..., rigid/nosquish, rigid/nve/nosquish, ..., and fix python/move, as a LAMMPS plugin.

   Fix python/move is a superset of LAMMPS's own, which it replaces where LAMMPS was built with its package PYTHON. The fix line names
   a Python class,

       fix ID group python/move "module.class"

   and the fix calls the methods of one instance of it. The class of another style is in fix_nosquish.INTEGRATORS; those of rigid/...,
   by which LAMMPS's suffix nosquish replaces its own rigid fixes, are in host/rigid_fixes.py. Everything that is Python's is in
   bridge.py; the two sides share the plain C struct Bridge. */

#include "python_move.h"

#include "computes.h"
#include "declaration.h"
#include "registration.h"

namespace {
namespace nosquish {

void FixPythonMove::setup(int vflag)
{
  v_init(vflag);
  push();
  take_virial();
  if (early) post_force(vflag);
  call_with_virial(bridge.setup, vflag);
}

void FixPythonMove::post_neighbor()
{
  if (bridge.flipped && box() != kept_box) {    // by fix deform
    point();
    tell_box();
    if (run(bridge.flipped)) kept_box = box();
  }
  if (bridge.follow && box() == kept_box) {
    point();
    if (run(bridge.follow)) return;    // if not, Python does it all again, and says why
  }
  call(bridge.post_neighbor);
  keep_state();
}

void FixPythonMove::initial_integrate(int vflag)
{
  if (!bridge.initial_integrate) end_run("the Python that holds its class has shut down");
  flush_log();
  v_init(vflag);
  stream_with_box();
  bridge.vflag = asked_by_others(vflag);
  const bool waits = bridge.phase == WAITING, for_python = update->ntimestep == bridge.begins;
  if (for_python && bridge.needs_energy) bridge.energy = potential();
  const Pass *passes = for_python ? nullptr : waits ? bridge.whole : bridge.phase == SET ? bridge.begin : nullptr;
  const bool changed = bridge.late && bridge.velocities_set;    // perhaps: Python finds out
  if (passes && !changed && run(passes)) {
    bridge.phase = HALF;
    bridge.velocities_set = 0;
    // if it fails, Python finds it broken, too, and says why
    if (cell_is_due(update->ntimestep - 1) && !run(bridge.cell)) call(bridge.initial_integrate, bridge.vflag);
  } else {
    call(bridge.initial_integrate, bridge.vflag);
  }
}

// On a step that nothing looks at, its end can wait for the next step, and be one pass with its begin.

void FixPythonMove::final_integrate()
{
  const bigint step = update->ntimestep;
  auto falls_on = [step](int every) { return every && step % every == 0; };
  push();
  const bool for_energy = step == bridge.energy_step, for_python = for_energy || falls_on(bridge.python_every);
  take_virial();
  if (!bridge.vflag) update->vflag_global = -1;    // whoever reads a virial nevertheless hears that there is none
  const bool looked_at = step == output->next || falls_on(bridge.velocities_every);
  if (bridge.may_wait && !bridge.vflag && !looked_at && !for_python) {
    bridge.phase = WAITING;
  } else if (bridge.end && bridge.phase == HALF && !for_python && run(bridge.end)) {
    bridge.phase = bridge.ended;
    if (looked_at) {
      run(bridge.velocities);
      bridge.velocities_set = 1;
    }
    if (bridge.vflag) {
      make_virial_per_atom();
      set_cell(VIRIAL, virial, 6, 0);
      set_cell(ATOM_VIRIAL, bridge.virial_per_atom, std::max(0, bridge.natoms), 9);
      if (!run(bridge.constraint_virial)) call_with_virial(bridge.final_integrate);    // which says why
      give_virial_per_atom();
    }
  } else {
    if (for_energy) bridge.energy = potential();
    call_with_virial(bridge.final_integrate);
    if (for_energy) {
      if (bridge.renews) {
        bridge.renews = 0;
        go_back();
        renew_forces();
        push();
        call_with_virial(bridge.renewed);
      }
      ask_for_energy(bridge.energy_step);
    }
    return;
  }
  if (pressure_is_due(step)) run(bridge.pressure);
}

void FixPythonMove::initial_integrate_respa(int vflag, int ilevel, int iloop)
{
  flush_log();
  if (ilevel == 0) v_init(vflag);
  call(bridge.initial_integrate_respa, vflag, ilevel, iloop);
}

void FixPythonMove::final_integrate_respa(int ilevel, int iloop)
{
  call(bridge.final_integrate_respa, ilevel, iloop);
}

// What acts on the bodies besides the forces of this step, which are known?

void FixPythonMove::push()
{
  if (!bridge.pushes) return;
  external.evaluate();
  call(bridge.push);
  external.count();
}

// Verlet ends its step in final_integrate, but fix deform changes the box behind that.

void FixPythonMove::end_of_step()
{
  stream_with_box();
  if (respa) call_with_virial(bridge.end_of_step);
  halt.end_run();
}

// Another fix changes the box, and all that is in it (0 before, 1 behind). The box is then that of the class.

void FixPythonMove::deform(int behind)
{
  if (!behind || !bridge.deform) return;    // if it cannot follow, it finds another box than it knows
  box.tell();
  run(bridge.deform);
  box.keep();
}

void FixPythonMove::stream_with_box()
{
  if (box.streams()) deform(1);
}

// For a loop, which has found the next box.

int64_t FixPythonMove::set_box(const double *numbers)
{
  if (bridge.held) clusters.find();    // ghost atoms are images by the box as it was
  box.set(numbers);
  facts.log(box.warning().c_str());
  return 0;
}

void FixPythonMove::init()
{
  halt.begin_again();
  respa = utils::strmatch(update->integrate_style, "^respa");
  if (respa && !(bridge.initial_integrate_respa && bridge.final_integrate_respa))
    facts.refuse("its class has no methods for run_style respa");
  if (respa && arrays.early) facts.refuse("bodyforces early is not for run_style respa: use run_style verlet");
  facts.refuse_casts();
  if (update->whichflag == 2) call(bridge.min_setup, 0);    // before pair styles that look bodies up
  bridge.stream_group = domain->deform_vremap ? domain->deform_groupbit : 0;
  if (bridge.stream_group)
    for (const auto &other : modify->get_fix_by_style("^deform")) other->init();    // it finds its rates, perhaps behind this fix
  for (const auto &other : modify->get_fix_by_style("^efield")) other->init();    // it looks its variables up: see `varies`
  box.begin_run();
  call(bridge.init);
  state.announce();
  exchange.refuse_stale_forces();
  if (!dynamic && bridge.follows_atoms)
    facts.warn("fix_modify dynamic/dof no has no effect: degrees of freedom are always those of the bodies there are");
  dynamic = 1;
  if (bridge.changes_box) pressure.ask_from(update->ntimestep);
  if (bridge.needs_energy)
    for (const bigint step : {update->ntimestep, (bigint) bridge.energy_step}) energy.ask_for(step);
}

void FixPythonMove::post_run()
{
  stream_with_box();
  call(bridge.post_run);
  halt.begin_again();
}

void FixPythonMove::write_restart(FILE *file)
{
  call(bridge.write_restart);
  state.write(file);
}

double FixPythonMove::compute_vector(int i)
{
  if (i >= size_vector)    // thermo_style and others may have been written for another fix of this ID
    facts.refuse("f_" + std::string(id) + "[" + std::to_string(i + 1) + "] was asked for, and this fix has " +
                 std::to_string(size_vector) + " such values: thermo_style, or what else names it, was for a fix with other words. "
                 "Write it anew behind this fix");
  return ask<double>(bridge.compute_vector, i);
}

double FixPythonMove::compute_array(int i, int j)
{
  if (i >= size_array_rows) return 0.0;    // LAMMPS asks for other rows too
  const std::array<int64_t, 3> now{update->ntimestep, bridge.phase, bridge.changes};
  if (bridge.array && now == array_when && !bridge.late) return bridge.array[i * size_array_cols + j];
  const double value = ask<double>(bridge.compute_array, i, j);
  array_when = {update->ntimestep, bridge.phase, bridge.changes};
  return value;
}

// Granular pair styles look up the mass of the body of each atom here. Between runs commands ask whether what they change is in
// bodies, to warn that it has no effect: it has one here. Fixes that insert molecules see whether their template, a place in
// LAMMPS's list of these, is that of the bodies.

void *FixPythonMove::extract(const char *name, int &dim)
{
  dim = 0;
  if (strcmp(name, "onemol") == 0) return molecules.first();
  dim = 1;
  if (strcmp(name, "body") == 0) return update->whichflag ? bridge.body : nullptr;
  return strcmp(name, "masstotal") == 0 ? bridge.masstotal : nullptr;
}

// These words of the bodies that are counted on this rank: how many rows, and where they are until the next call.

int FixPythonMove::rows_of_rank(const char *words, int group, double *&values)
{
  int64_t found[2] = {};
  call(bridge.rows_of_rank, words, group, static_cast<int64_t *>(found));
  values = reinterpret_cast<double *>(found[0]);
  return (int) found[1];
}

}    // namespace nosquish
}    // namespace
