/* The cells through which loops see LAMMPS's arrays. */

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

  // Tell KOKKOS what may be newer on the host behind each hook. As for any fix of which it knows no more, it brings what is newer on
  // the card to the host before each, and what LAMMPS does within one, as where hybrid Monte Carlo goes back, begins and ends with
  // the host's arrays.

  void declare() const { fix->datamask_modify = changed_arrays(atom); }

  // Keep the forces of now for the bodies: fixes behind this one add theirs to LAMMPS's own arrays.

  void keep_forces()
  {
    auto keep = [this](F2 &cell, std::vector<double> &kept, double **array) {
      if (!array || !atom->nlocal) return;
      kept.assign(array[0], array[0] + 3 * atom->nlocal);
      cell.point(kept.data(), atom->nlocal, 3);
    };
    keep(bridge.arrays->atom_f, kept_force, atom->f);
    keep(bridge.arrays->atom_torque, kept_torque, atom->torque);
  }

  // Point the cells at LAMMPS's arrays as they are.

  void point(const Exchange &exchange)
  {
    Arrays &cells = *bridge.arrays;
    const int64_t n = atom->nlocal;
    auto point_forces = [this, n](F2 &cell, const std::vector<double> &kept, double **array) {
      if (early && array && n && (int64_t) kept.size() == 3 * n) cell.point(kept.data(), n, 3);
      else cell.point(array, n, 3);
    };
    cells.atom_x.point(atom->x, n, 3);
    cells.atom_v.point(atom->v, n, 3);
    point_forces(cells.atom_f, kept_force, atom->f);
    point_forces(cells.atom_torque, kept_torque, atom->torque);
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
    cells.clusters = cells.counted_f = {};    // filled where they are needed
  }

 private:
  std::vector<double> kept_force, kept_torque;
};

}    // namespace nosquish
}    // namespace

#endif
