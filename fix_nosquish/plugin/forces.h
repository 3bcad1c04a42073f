/* LAMMPS's forces: iterate over bonded styles, and compute all forces again after atoms were moved back. */

#ifndef FIX_NOSQUISH_FORCES_H
#define FIX_NOSQUISH_FORCES_H

#include "exchange.h"

#include "angle.h"
#include "bond.h"
#include "dihedral.h"
#include "domain.h"
#include "force.h"
#include "improper.h"
#include "kspace.h"
#include "neighbor.h"
#include "pair.h"
#include "update.h"

#include <algorithm>
#include <cmath>

namespace {
namespace nosquish {

// Call a function for the styles of bonded forces, in LAMMPS's order.

template <typename Function> void for_bonded(const Force *force, const Atom *atom, Function function)
{
  if (atom->molecular == Atom::ATOMIC) return;
  if (force->bond) function(force->bond);
  if (force->angle) function(force->angle);
  if (force->dihedral) function(force->dihedral);
  if (force->improper) function(force->improper);
}

// Moves atoms back after a trajectory of hybrid Monte Carlo that was rejected.

class GoingBack : public Part {
 public:
  using Part::Part;

  // Displace the atoms of bodies by what is stored as their velocities, in parts so small that an atom goes at most to the next rank
  // in each exchange.

  void move(const Exchange &exchange) const
  {
    double width[3], furthest = 0.0;
    for (int k = 0; k < 3; k++)
      width[k] = domain->triclinic ? domain->prd[k] * (domain->subhi_lamda[k] - domain->sublo_lamda[k])
                                   : domain->subhi[k] - domain->sublo[k];
    for (int i = 0; i < atom->nlocal; i++)
      for (int k = 0; k < 3 && exchange.moves(i); k++) furthest = std::max(furthest, std::fabs(atom->v[i][k]));
    const double local[2] = {furthest, -*std::min_element(width, width + domain->dimension)};
    double global[2];
    MPI_Allreduce(local, global, 2, MPI_DOUBLE, MPI_MAX, world);
    const int parts = std::max(1, (int) std::ceil(global[0] / (0.5 * -global[1])));
    for (int part = 0; part < parts; part++) {
      for (int i = 0; i < atom->nlocal; i++)
        for (int k = 0; k < 3 && exchange.moves(i); k++) atom->x[i][k] += atom->v[i][k] / parts;
      if (domain->triclinic) domain->x2lamda(atom->nlocal);
      domain->pbc();
      if (domain->box_change) {    // as shrink-wrapped faces do
        domain->reset_box();
        comm->setup();
        if (neighbor->style) neighbor->setup_bins();
      }
      comm->exchange();
      if (domain->triclinic && part < parts - 1) domain->lamda2x(atom->nlocal);
    }
  }

  // Build neighbor lists and compute forces, as LAMMPS does in a step between the exchange of atoms and final_integrate.

  void renew_forces() const
  {
    comm->borders();
    if (domain->triclinic) domain->lamda2x(atom->nlocal + atom->nghost);
    if (modify->n_pre_neighbor) modify->pre_neighbor();
    neighbor->build(1);
    if (modify->n_post_neighbor) modify->post_neighbor();

    const int vflag = bridge.vflag, eflag = 1 + 2 * (update->eflag_atom == update->ntimestep);    // of all, and of each atom
    const auto numbers = 3 * (size_t) (atom->nlocal + atom->nghost);
    for (double **array : {atom->f, atom->torque_flag ? atom->torque : nullptr})
      if (array && numbers) std::fill_n(array[0], numbers, 0.0);
    if (modify->n_pre_force) modify->pre_force(vflag);
    if (force->pair && force->pair->compute_flag) force->pair->compute(eflag, vflag);
    for_bonded(force, atom, [=](auto *style) { style->compute(eflag, vflag); });
    if (force->kspace && force->kspace->compute_flag) force->kspace->compute(eflag, vflag);
    if (modify->n_pre_reverse) modify->pre_reverse(eflag, vflag);
    if (force->newton) comm->reverse_comm();
    if (modify->n_post_force_any) modify->post_force(vflag);
  }
};

}    // namespace nosquish
}    // namespace

#endif
