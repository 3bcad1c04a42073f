/* A LAMMPS plugin with the fixes nosquish/nve, /nvt, ..., rigid/nosquish, rigid/nve/nosquish, ..., and python/move.

   A fix calls the methods of a run.fix.Fix in Python, which has an integrator. Fix python/move names its class,

       fix ID group python/move "module.class words"

   and replaces LAMMPS's own fix of this name. The classes of other styles are in fix_nosquish.INTEGRATORS and host/rigid_fixes.py. The Python side is bridge.py; both sides share the struct Bridge (structs.py). */

#include "fix_nosquish.h"

#include "computes.h"
#include "declaration.h"
#include "registration.h"

namespace {
namespace nosquish {

void FixNosquish::setup(int vflag)
{
  minimized = false;
  v_init(vflag);
  apply_external();
  pressure.sum_virial(box.volume());
  if (arrays.early) post_force(vflag);
  bridge.vflag = vflag;
  with_virial([&] {
    if (!perform(bridge.at_setup)) call(bridge.setup, vflag);
  });
}

void FixNosquish::post_neighbor()
{
  point();
  if (bridge.at_flipped && box.now() != box.known) {    // by fix deform
    box.note_deformed();
    perform(bridge.at_flipped);
    box.note();
  }
  const int64_t other = (int64_t) 1 << OTHER_BOX;
  bridge.facts = box.now() == box.known ? bridge.facts & ~other : bridge.facts | other;
  if (!perform(bridge.at_neighbor)) call(bridge.post_neighbor);
  box.note();
}

void FixNosquish::initial_integrate(int vflag)
{
  if (!bridge.initial_integrate) failures.end_run("the Python that holds its class has shut down");
  if (minimized) failures.refuse("'run N pre no' cannot follow a minimization: use 'run N pre yes'");
  if (logfile) fflush(logfile);
  v_init(vflag);
  note_remapping_box();
  bridge.vflag = pressure.requested_by_others(vflag);
  if (!perform(bridge.at_begin)) call(bridge.initial_integrate, bridge.vflag);
}

void FixNosquish::final_integrate()
{
  apply_external();
  pressure.sum_virial(box.volume());
  if (!bridge.vflag) update->vflag_global = -1;    // whoever reads a virial nevertheless hears that there is none
  with_virial([&] {
    if (!perform(bridge.at_end)) call(bridge.final_integrate);
  });
}

// These two min styles let fixes have degrees of freedom. Norm max looks at only one of three of them.

void FixNosquish::begin_minimization()
{
  const std::string style = update->minimize_style;
  const auto &minimizer = *reinterpret_cast<const Minimizer *>(update->minimize);
  if (style != "cg" && style != "sd")
    failures.refuse("min_style " + style + " would move the atoms of rigid bodies individually: use 'min_style cg' or 'min_style sd', "
                 "which keep bodies rigid");
  if (minimizer.searchflag != 1) failures.refuse(another_class("Min"));    // as it is of these two
  if (minimizer.normstyle == 1)
    failures.refuse("min_modify norm max leaves out two thirds of the forces on rigid bodies: use 'norm two' or 'norm inf'");
  if (!(minimizer.dmax > 0.0)) failures.refuse("min_modify dmax must be above zero");
  bridge.dmax = minimizer.dmax;
}

void FixNosquish::min_post_force(int vflag)
{
  v_init(vflag);
  bridge.vflag = vflag;
  if (arrays.early) arrays.store_forces();
}

// All fixes have added their forces. The forces on the atoms of bodies are set to zero, because they would move atoms individually.

double FixNosquish::min_energy(double *forces)
{
  with_virial([&] { call(bridge.min_force, address(forces)); });
  bridge.vflag = 0;
  minimized = true;
  for (int i = 0; i < atom->nlocal; i++)
    if (exchange.moves(i)) std::fill_n(atom->f[i], 3, 0.0);
  return 0.0;
}

// The bits of When in this step.

int64_t FixNosquish::now() const
{
  const bigint step = update->ntimestep;
  const auto falls_on = [step](int every) { return every && step % every == 0; };
  const std::pair<When, bool> holds[] = {
      {CALLED, step == bridge.begins},
      {SHOWN, step == output->next || falls_on(bridge.velocities_every)},
      {VIRIAL_ASKED, bridge.vflag},
      {TABLE, falls_on(bridge.table_every)},
      {ENERGY, step == bridge.energy_step},
      {MOVES_BOX, pressure.box_is_due(step - 1)},
      {PRESSURE, pressure.is_due(step)},
  };
  int64_t bits = bridge.facts;
  for (const auto &[bit, so] : holds) bits |= (int64_t) so << bit;
  return bits;
}

// Do the actions of a hook; returns false if it has none. run/schedule.py has the same in Python.

bool FixNosquish::perform(const Action *action)
{
  if (!action) return false;
  const int64_t now = this->now();
  for (; action->phases; action++) {
    if (!(action->phases >> bridge.phase & 1) || (action->when & ~now) || (action->unless & now)) continue;
    const int64_t result = run_passes(action->passes);
    if (result || (!action->passes && action->number >= 0)) call(bridge.run_action, action->number, result);
    if (action->then >= 0) bridge.phase = (int32_t) action->then, bridge.array = nullptr;
    bridge.facts = (bridge.facts | action->sets) & ~action->clears;
  }
  return true;
}

// Displace atoms by what is stored as their velocities, and compute the forces. Python gets false after an error of LAMMPS.

bool FixNosquish::go_back()
{
  back.move(exchange);
  back.renew_forces();
  apply_external();
  make_virial_per_atom();    // for the atoms that this rank has now
  return true;
}

void FixNosquish::initial_integrate_respa(int vflag, int ilevel, int iloop)
{
  if (logfile) fflush(logfile);
  if (ilevel == 0) v_init(vflag);
  call(bridge.initial_integrate_respa, vflag, ilevel, iloop);
}

void FixNosquish::final_integrate_respa(int ilevel, int iloop)
{
  call(bridge.final_integrate_respa, ilevel, iloop);
}

// Evaluate external forces on bodies; the forces of this step are known.

void FixNosquish::apply_external()
{
  if (!bridge.pushes) return;
  external.evaluate();
  call(bridge.push);
  external.report();
}

// Fix deform changes the box at the end of a step, after final_integrate.

void FixNosquish::end_of_step()
{
  note_remapping_box();
  if (respa) with_virial([this] { call(bridge.end_of_step); });
}

// Another fix changes the box and all that is in it; called with 0 before and 1 after.

void FixNosquish::deform(int after)
{
  if (!after || !bridge.at_deform) return;    // a class that cannot follow will find that the box differs
  box.note_deformed();
  perform(bridge.at_deform);
  box.note();
}

void FixNosquish::note_remapping_box()
{
  if (box.was_remapped()) deform(1);
}

// Set the box that a loop has computed.

int64_t FixNosquish::set_box(const double *numbers)
{
  if (bridge.held) clusters.find();    // ghost atoms are images by the box as it was
  box.set(numbers);
  return 0;
}

void FixNosquish::init()
{
  respa = utils::strmatch(update->integrate_style, "^respa");
  if (respa && arrays.early) failures.refuse("bodyforces early is not for run_style respa: use run_style verlet");
  others.refuse_casts();
  bridge.dmax = 0.0;
  if (update->whichflag == 2) begin_minimization();
  bridge.remap_group = domain->deform_vremap ? domain->deform_groupbit : 0;
  if (bridge.remap_group)
    for (const auto &other : modify->get_fix_by_style("^deform")) other->init();    // it computes its rates, perhaps after this fix
  for (const auto &other : modify->get_fix_by_style("^efield")) other->init();    // it looks up its variables: see `describe`
  box.begin_run();
  bridge.ghost_velocity = comm->ghost_velocity;
  bridge.scalar_pressure = force->kspace && force->kspace->scalar_pressure_flag;
  call(bridge.init);
  exchange.refuse_stale_forces();
  if (!dynamic)
    failures.warn("fix_modify dynamic/dof no has no effect: degrees of freedom are always those of the bodies there are");
  dynamic = 1;
  if (bridge.box_every) pressure.request_from(update->ntimestep);
  if (bridge.needs_energy) energy.request(update->ntimestep);
}

void FixNosquish::post_run()
{
  note_remapping_box();
  call(bridge.post_run);
}

void FixNosquish::write_restart(FILE *file)
{
  call(bridge.keep_bodies);
  call(bridge.write_restart);
  state.write(file);
}

double FixNosquish::compute_vector(int i)
{
  if (i >= size_vector)    // thermo_style may have been written for another fix of this ID
    failures.refuse("f_" + std::string(id) + "[" + std::to_string(i + 1) + "] was asked for, and this fix has " +
                 std::to_string(size_vector) + " such values: thermo_style, or what else names it, was for a fix with other words. "
                 "Write it anew behind this fix");
  return query<double>(bridge.compute_vector, i);
}

double FixNosquish::compute_array(int i, int j)
{
  if (i >= size_array_rows) return 0.0;    // LAMMPS also asks for other rows
  if (bridge.array && !(bridge.facts >> LATE & 1)) return bridge.array[i * size_array_cols + j];
  return query<double>(bridge.compute_array, i, j);
}

// Granular pair styles ask for the mass of each atom's body. Between runs commands ask whether an atom is in a body, to warn that a
// change has no effect; here it has one, so they get null. Fixes that insert molecules compare the template.

void *FixNosquish::extract(const char *name, int &dim)
{
  dim = 0;
  if (strcmp(name, "onemol") == 0) return molecules.first();
  dim = 1;
  if (strcmp(name, "body") == 0) return update->whichflag ? bridge.body : nullptr;
  return strcmp(name, "masstotal") == 0 ? bridge.masstotal : nullptr;
}

// The values of these words for the bodies that this rank counts: the number of rows, and the rows, valid until the next call.

int FixNosquish::rows_of_rank(const char *words, int group, double *&values)
{
  int64_t rows[2] = {};
  call(bridge.rows_of_rank, words, group, static_cast<int64_t *>(rows));
  values = reinterpret_cast<double *>(rows[0]);
  return (int) rows[1];
}

}    // namespace nosquish
}    // namespace
