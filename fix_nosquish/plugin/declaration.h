/* The constructor of the fix, what it declares to LAMMPS and to Python, and fix_modify. */

#ifndef FIX_NOSQUISH_DECLARATION_H
#define FIX_NOSQUISH_DECLARATION_H

#include "fix_nosquish.h"

#include "universe.h"

namespace {
namespace nosquish {

FixNosquish::FixNosquish(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  const bool quoted = PYTHON_MOVE == arg[2];
  if (quoted && narg < 4) utils::missing_cmd_args(FLERR, "fix python/move", error);
  if (quoted && narg > 4) failures.refuse("put the class and its words in quotes: \"" + std::string(arg[3]) + " " + arg[4] + " ...\"");

  time_integrate = 1;
  dynamic_group_allow = 1;
  dynamic = 1;    // see init()

  const auto obstacle = start_python();
  if (!obstacle.empty()) failures.end_run(obstacle);    // other ranks may have started Python and wait

  fill_bridge();
  exchange.make_arrays();
  state.find_bodies();
  const auto line = utils::join_words({arg + 2, arg + narg}, "\n");
  bridge.line = line.c_str();
  const auto address = std::to_string(reinterpret_cast<uintptr_t>(static_cast<Bridge *>(&bridge)));
  run_python("__import__('fix_nosquish.plugin.bridge', fromlist=['attach']).attach(" + address + ")");
  bridge.line = nullptr;
  bridge.kept_rows = 0;    // LAMMPS deletes what it has read
  if (bridge.outcome != DONE) failures.end_run(bridge.message, 5.0);    // imports may take their time

  if (lmp->citeme && (!quoted || std::string(arg[3]).rfind("fix_nosquish.", 0) == 0)) lmp->citeme->add(PAPER);
  if (bridge.box_every) pressure.add("_virial", " all pressure NULL virial");
  if (bridge.needs_energy) energy.add("_energy", " all pe");
  declare();
  exchange.begin();
  state.adopt();
}

// Fill in the addresses of data and functions for Python.

void FixNosquish::fill_bridge()
{
  using Self = FixNosquish;
  bridge.checksum = CHECKSUM;
  bridge.fix = this;
  bridge.lammps = lmp;
  bridge.fix_id = id;
  bridge.group = group->names[igroup];
  bridge.virial = virial;
  bridge.rate = domain->h_rate;
  bridge.forces_virial = pressure.virial;
  bridge.deformed_box = box.deformed.data();
  bridge.external_sums = external.energy_and_virial;
  bridge.world = universe->iworld;
  bridge.next_output = &output->next;
  bridge.begin_step = &update->beginstep;
  bridge.end_step = &update->endstep;
  bridge.last_step = &update->laststep;
  bridge.begins = bridge.energy_step = bridge.argument = bridge.rotor = -1;
  strcpy(bridge.message, "cannot import fix_nosquish.plugin.bridge");

  bridge.log = Lend<&OtherFixes::log, &Self::others>();
  bridge.nth_fix = Lend<&OtherFixes::describe, &Self::others>();
  bridge.command = Lend<&OtherFixes::last_command, &Self::others>();
  bridge.removed_freedom = Lend<&OtherFixes::removed_freedom, &Self::others>();
  bridge.begin_step_of = Lend<&OtherFixes::begin_step_of, &Self::others>();
  bridge.pair_style = Lend<&OtherFixes::pair_style, &Self::others>();
  bridge.gravity = Lend<&OtherFixes::gravity, &Self::others>();

  bridge.point = Lend<&Self::point>();
  bridge.now = Lend<&Self::now>();
  bridge.potential = Lend<&PotentialEnergy::value, &Self::energy>();
  bridge.request_energy = Lend<&PotentialEnergy::request, &Self::energy>();
  bridge.go_back = Lend<&Self::go_back>();
  bridge.set_box = Lend<&Self::set_box>();
  bridge.flip_box = Lend<&Box::flip, &Self::box>();
  bridge.find_clusters = Lend<&Clusters::find, &Self::clusters>();
  bridge.set_array_rows = Lend<&Self::set_array_rows>();
  bridge.particles = Lend<&Particles::read, &Self::particles>();
  bridge.orient_atom = Lend<&Particles::orient, &Self::particles>();
  bridge.molecule = Lend<&Molecules::describe, &Self::molecules>();
}

// Set the flags of the fix from what its class declares.

void FixNosquish::declare()
{
  dof_flag = virial_global_flag = thermo_virial = virial_peratom_flag = restart_global = 1;
  centroidstressflag = CENTROID_AVAIL;    // because the virial of an atom is not symmetric
  restart_file = bridge.restart_file;
  ecouple_flag = bridge.couples;
  if (bridge.box_every) {
    comm_forward = comm_reverse = 3;
    box_change |= BOX_CHANGE_SIZE | (domain->triclinic ? BOX_CHANGE_SHAPE : 0);
    no_change_box = 1;
    pre_exchange_migrate = bridge.flips;
  }
  rigid_flag = 1;    // fix deform calls deform() of rigid fixes

  scalar_flag = vector_flag = array_flag = 1;
  extscalar = bridge.couples;
  extarray = 0;
  extensive.assign(bridge.vector_extensive, bridge.vector_extensive + bridge.vector_size);
  size_vector = bridge.vector_size;
  extvector = -1;
  extlist = extensive.data();
  size_array_cols = bridge.array_columns;
  size_array_rows = std::max(0, bridge.array_rows);
  size_array_rows_variable = bridge.array_rows < 0;    // fix ave/time needs a fixed number
  global_freq = 1;
  arrays.declare();
}

int FixNosquish::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE | INITIAL_INTEGRATE_RESPA | FINAL_INTEGRATE_RESPA | (bridge.flips ? PRE_EXCHANGE : 0) |
      (bridge.box_every ? PRE_REVERSE : 0) | POST_NEIGHBOR | END_OF_STEP | POST_RUN | MIN_POST_NEIGHBOR | MIN_POST_FORCE | MIN_ENERGY;
}

// external: forces and torques on bodies, to the end of the command; Python interprets the words. bodyforces: bodies have the forces of
// all fixes (late), or of those before this one (early). temp and press: accepted as by LAMMPS's rigid fixes, without effect.

int FixNosquish::modify_param(int narg, char **arg)
{
  const std::string word = arg[0], value = narg > 1 ? arg[1] : "";
  if (word == "external") {
    call(bridge.modify_external, external.words_of(narg, arg).c_str());
    external.replace_fix();
    return narg;
  }
  if (narg < 2) return 0;
  if ((bridge.box_every && (word == "temp" || word == "press")) || (word == "temp" && replaces(style))) {
    failures.warn("fix_modify " + word + " " + value + " has no effect: temperature and pressure are those of what this fix moves, and of "
               "the atoms that its box takes along");
    return 2;
  }
  if (word != "bodyforces") return 0;
  if (value != "early" && value != "late") failures.refuse("bodyforces " + value + ": expected early or late");
  arrays.early = value == "early";
  int &mask = modify->fmask[modify->find_fix(id)];
  mask = arrays.early ? mask | POST_FORCE : mask & ~POST_FORCE;
  return 2;
}

}    // namespace nosquish
}    // namespace

#endif
