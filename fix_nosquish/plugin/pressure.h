/* Virial and energy of LAMMPS's forces for the integrator. */

#ifndef FIX_NOSQUISH_PRESSURE_H
#define FIX_NOSQUISH_PRESSURE_H

#include "box.h"
#include "clusters.h"
#include "failures.h"
#include "forces.h"

#include "compute.h"
#include "modify.h"
#include "output.h"

#include <utility>
#include <vector>

namespace {
namespace nosquish {

// A compute that this fix adds, so that LAMMPS tallies energy or virial. A script may delete it.

class OwnCompute : public Part {
 public:
  using Part::Part;

  ~OwnCompute() override
  {
    if (!id.empty() && modify->get_compute_by_id(id)) modify->delete_compute(id);
  }

  void add(const std::string &what, const std::string &words)
  {
    const std::string name = std::string(fix->id) + what;
    modify->add_compute(name + words);
    id = name;    // not before: add_compute refuses an ID that a script uses
  }

  Compute *find() const
  {
    Compute *compute = modify->get_compute_by_id(id);
    if (!compute) refuse("compute " + id + " is gone, which this fix has added and needs: remove the uncompute");
    return compute;
  }

  void request(bigint step) const { find()->addstep(step); }

 protected:
  std::string id;
};

class PotentialEnergy : public OwnCompute {
 public:
  using OwnCompute::OwnCompute;

  // The potential energy of the last forces, if LAMMPS has tallied it. Compute pe must not know that a step has begun since.

  double value() const
  {
    Compute *const energies = find();
    const bigint step = std::exchange(update->ntimestep, update->eflag_global);
    const double energy = energies->compute_scalar();
    update->ntimestep = step;
    return energy;
  }
};

// The virial in steps in which the box changes, and in the steps after them.

class Pressure : public OwnCompute {
 public:
  double virial[6] = {};    // of all ranks, without this fix

  using OwnCompute::OwnCompute;

  bool box_is_due(bigint step) const { return bridge.box_every && step % bridge.box_every == 0; }
  bool is_due(bigint step) const { return box_is_due(step) || box_is_due(step - 1); }

  // Have LAMMPS tally the virial in the first step, from this one on, that needs it.

  void request_from(bigint step) const
  {
    const bigint every = bridge.box_every;
    request(box_is_due(step - 1) ? step : (step + every - 1) / every * every);
  }

  // The virial that others than this fix need in this step. The new box does not need the constraint virial.

  int requested_by_others(int vflag) const
  {
    const bigint step = update->ntimestep;
    if (!is_due(step) || (vflag & (VIRIAL_ATOM | VIRIAL_CENTROID))) return vflag;
    if (output->any_time_dumps && output->next_time_dump_any == step) return vflag;
    for (const auto &compute : modify->get_compute_list())
      if (compute->pressflag && id != compute->id && compute->matchstep(step)) return vflag;
    return 0;
  }

  // Sum the virial of LAMMPS's forces, and of the fixes that LAMMPS counts, if it is needed in this step.

  void sum_virial(double volume)
  {
    if (!is_due(update->ntimestep)) return;
    if (update->vflag_global != update->ntimestep)
      refuse("LAMMPS has not tallied the virial that the new box needs: begin the run with 'pre yes'");
    double sums[6] = {};
    auto add = [](double *to, const double *virial) {
      for (int k = 0; k < 6; k++) to[k] += virial[k];
    };
    if (force->pair) add(sums, force->pair->virial);
    for_bonded(force, atom, [&](auto *style) { add(sums, style->virial); });
    for (const auto &other : modify->get_fix_list())
      if (other != fix && other->thermo_virial && !(bridge.counts && constrains(other))) add(sums, other->virial);
    MPI_Allreduce(sums, virial, 6, MPI_DOUBLE, MPI_SUM, world);
    if (force->kspace) add(virial, force->kspace->virial);
    if (force->pair && force->pair->tail_flag)
      for (int k = 0; k < domain->dimension; k++) virial[k] += force->pair->ptail / volume;
    request_from(update->ntimestep + 1);
  }

  // Store the forces that LAMMPS's virial counts (pair, bonded, kspace) before fixes add theirs.

  void store_counted_forces()
  {
    if (!bridge.counts || !is_due(update->ntimestep)) return;
    const int local = atom->nlocal, all = local + atom->nghost;
    counted.assign(3 * (size_t) all, 0.0);
    for (int i = 0; i < (force->newton ? all : local); i++) std::copy_n(atom->f[i], 3, &counted[3 * (size_t) i]);
    if (force->newton) comm->reverse_comm(fix);
    bridge.arrays->counted_f.point(counted.data(), local, 3);
  }

  int pack(int n, int first, double *buffer) const
  {
    std::copy_n(&counted[3 * (size_t) first], 3 * n, buffer);
    return 3 * n;
  }

  void unpack(int n, const int *list, const double *buffer)
  {
    for (int k = 0; k < n; k++)
      for (int c = 0; c < 3; c++) counted[3 * (size_t) list[k] + c] += *buffer++;
  }

 private:
  std::vector<double> counted;    // forces on local and ghost atoms
};

}    // namespace nosquish
}    // namespace

#endif
