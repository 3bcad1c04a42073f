/* The simulation box, if the class or another fix changes it. */

#ifndef FIX_NOSQUISH_BOX_H
#define FIX_NOSQUISH_BOX_H

#include "part.h"

#include "atom.h"
#include "domain.h"
#include "force.h"
#include "kspace.h"
#include "update.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace {
namespace nosquish {

class Box : public Part {
 public:
  using Numbers = std::array<double, 9>;    // lowest and highest coordinates, xy, xz, yz
  Numbers known{};       // the box of the passes
  Numbers deformed{};    // the argument of the passes deform and flipped

  using Part::Part;

  Numbers now() const
  {
    const double *lo = domain->boxlo, *hi = domain->boxhi;
    return {lo[0], lo[1], lo[2], hi[0], hi[1], hi[2], domain->xy, domain->xz, domain->yz};
  }

  void note() { known = now(); }
  void note_deformed() { deformed = now(); }

  void begin_run() { std::copy_n(domain->h_rate, 6, first_rate); }

  // Set the box; the atoms are where it has them.

  void set(const double *numbers)
  {
    std::copy_n(numbers, 3, domain->boxlo);
    std::copy_n(numbers + 3, 3, domain->boxhi);
    if (domain->triclinic) {
      domain->xy = numbers[6];
      domain->xz = numbers[7];
      domain->yz = numbers[8];
    }
    domain->set_global_box();
    domain->set_local_box();
    if (force->kspace) force->kspace->setup();
    note();
  }

  // Set the box to other vectors of the same lattice. After the numbers of `set` come the multiples of a added to b, of a to c, and of b
  // to c. Nothing moves in space, but atoms belong to other ranks, perhaps far away, so LAMMPS sends them there in several exchanges.

  int64_t flip(const double *numbers)
  {
    const double xy = numbers[9], xz = numbers[10], yz = numbers[11];
    domain->x2lamda(atom->nlocal);
    domain->pbc();
    comm->setup();    // fix balance may just have changed the subdomains
    comm->exchange();
    if (yz != 0.0) {
      domain->image_flip(0, 0, (int) yz);
      shift_lamda(1, 0.0, yz);
    }
    if (xy != 0.0 || xz != 0.0) {
      domain->image_flip((int) xy, (int) xz, 0);
      shift_lamda(0, xy, xz);
    }
    set(numbers);
    domain->lamda2x(atom->nlocal);
    return 0;
  }

  double volume() const
  {
    const double area = domain->xprd * domain->yprd;
    return domain->dimension == 3 ? area * domain->zprd : area;
  }

  // With remap v, fix deform changes the box without calling other fixes. Returns whether it has done so. Ends the run if its rates
  // are others than when the run began, from which bodies that cross a face get their velocities.

  bool was_remapped() const
  {
    if (!bridge.remap_group || !bridge.at_deform || now() == known) return false;
    if (!std::equal(first_rate, first_rate + 6, domain->h_rate))
      refuse("fix deform has other rates now than when the run began: with remap v bodies follow constant ones, as of erate, vel, "
             "delta, scale or final");
    return true;
  }

 private:
  double first_rate[6] = {};    // h_rate when the run began

  // Shift an axis of the atoms' lamda coordinates by -y and -z times the other two (about the center of the box), in parts so small
  // that an atom goes at most to the next rank in each exchange.

  void shift_lamda(int axis, double y, double z)
  {
    const double width = domain->subhi_lamda[axis] - domain->sublo_lamda[axis];
    double least = 0.0;
    MPI_Allreduce(&width, &least, 1, MPI_DOUBLE, MPI_MIN, world);
    const int parts = (int) std::ceil(0.5 * (std::fabs(y) + std::fabs(z)) / (0.9 * least));
    for (int part = 0; part < parts; part++) {
      double **x = atom->x;
      for (int i = 0; i < atom->nlocal; i++) x[i][axis] -= (y * (x[i][1] - 0.5) + z * (x[i][2] - 0.5)) / parts;
      domain->pbc();
      comm->exchange();
    }
  }
};

}    // namespace nosquish
}    // namespace

#endif
