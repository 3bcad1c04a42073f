/* The cells for LAMMPS's arrays of atoms. */

#ifndef FIX_NOSQUISH_ARRAYS_H
#define FIX_NOSQUISH_ARRAYS_H

#include "exchange.h"
#include "lammps_versions.h"

#include <vector>

namespace {
namespace nosquish {

class AtomArrays : public Part {
 public:
  bool early = false;    // bodies have the forces of the fixes before this one (fix_modify bodyforces early)

  using Part::Part;

  // Tell KOKKOS which arrays a hook may change on the host. Before a hook it copies what is newer on the device to the host. So what
  // LAMMPS does within a hook, such as new forces for hybrid Monte Carlo, uses the arrays of the host.

  void declare() const { fix->datamask_modify = changed_arrays(atom); }

  // Store the present forces for the bodies: fixes after this one add theirs to LAMMPS's arrays.

  void store_forces()
  {
    auto store = [this](F2 &cell, std::vector<double> &stored, double **array) {
      if (!array || !atom->nlocal) return;
      stored.assign(array[0], array[0] + 3 * atom->nlocal);
      cell.point(stored.data(), atom->nlocal, 3);
    };
    store(bridge.arrays->atom_f, stored_force, atom->f);
    store(bridge.arrays->atom_torque, stored_torque, atom->torque);
  }

  // Set the cells to LAMMPS's arrays.

  void point(const Exchange &exchange)
  {
    Arrays &cells = *bridge.arrays;
    const int64_t n = atom->nlocal;
    auto point_forces = [this, n](F2 &cell, const std::vector<double> &stored, double **array) {
      if (early && array && n && (int64_t) stored.size() == 3 * n) cell.point(stored.data(), n, 3);
      else cell.point(array, n, 3);
    };
    cells.atom_x.point(atom->x, n, 3);
    cells.atom_v.point(atom->v, n, 3);
    point_forces(cells.atom_f, stored_force, atom->f);
    point_forces(cells.atom_torque, stored_torque, atom->torque);
    cells.atom_omega.point(atom->omega, n, 3);
    cells.atom_angmom.point(atom->angmom, n, 3);
    cells.atom_mu.point(atom->mu, n, 4);
    cells.atom_mass.point(atom->rmass, n);
    cells.type_mass.point(atom->mass, atom->ntypes + 1);
    cells.type.point(atom->type, n);
    cells.groups.point(atom->mask, n);
    cells.origins.point(exchange.origin, n);
    cells.membership.point(exchange.membership, n);
    cells.arrived.point(exchange.arrived.data(), cells.arrived.rows, bridge.carries);
    cells.clusters = cells.counted_f = {};    // set when they are needed
  }

 private:
  std::vector<double> stored_force, stored_torque;
};

}    // namespace nosquish
}    // namespace

#endif
