/* Whether LAMMPS's objects lie in memory as the headers say with which this was compiled. A LAMMPS of the same version that was
   patched may have other members, and its version number does not tell. So the addresses and numbers that LAMMPS's library interface
   returns are compared with those that this code finds, of each class one of the last members that the interface knows.

   The library interface does not know: members and methods of Fix; Pair, Bond, Angle, Dihedral, Improper and KSpace; Group, Input and
   Error. */

#ifndef FIX_NOSQUISH_LAYOUT_H
#define FIX_NOSQUISH_LAYOUT_H

#include "styles.h"

#include "atom.h"
#include "comm.h"
#include "compute.h"
#include "domain.h"
#include "fix.h"
#include "force.h"
#include "lattice.h"
#include "library.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "pointers.h"
#include "universe.h"
#include "update.h"

#include <utility>

namespace {
namespace nosquish {

class Layout : private Pointers {
 public:
  using Pointers::Pointers;

  // The class LAMMPS, by which all others are found.

  bool lammps() const { return lmp->num_ver == lammps_version(lmp) && world == MPI_Comm_f2c(lammps_get_mpi_comm(lmp)); }

  // The classes that are needed to register styles, when LAMMPS starts.

  bool styles() const { return lammps() && lists_of_modify(); }

  // The first class that differs; null if none does. All ranks run the same LAMMPS and find the same.

  const char *differs() const
  {
    if (!lammps()) return "LAMMPS";
    const auto press = modify->get_compute_by_id("thermo_press");
    const std::pair<const char *, bool> classes[] = {
        {"Update", at("units", update->unit_style)},
        {"Domain", at("xlattice", &domain->lattice->xlattice)},
        {"Force", at("special_coul", force->special_coul)},
        {"Comm", at("procgrid", comm->procgrid)},
        {"Neighbor", at("neigh_bondlist", neighbor->bondlist) && is("neigh_dist_check", neighbor->dist_check)},
        {"Atom", at("map_style", &atom->map_style) && at("nextsort", &atom->nextsort) && is("ntypes", atom->ntypes)},
        {"Modify", lists_of_modify()},
        {"Compute", !press || press->pressflag == 1},
        {"Universe", is("universe_size", universe->nprocs)},
        {"Output", is("thermo_every", output->thermo_every) && lammps_id_count(lmp, "dump") == output->ndump},
    };
    for (const auto &[name, alike] : classes)
      if (!alike) return name;
    return nullptr;
  }

 private:
  // What an older LAMMPS does not know counts as alike.

  bool at(const char *name, const void *ours) const
  {
    const void *theirs = lammps_extract_global(lmp, name);
    return !theirs || theirs == ours;
  }

  bool is(const char *name, int ours) const
  {
    const int theirs = lammps_extract_setting(lmp, name);
    return theirs < 0 || theirs == ours;
  }

  bool lists_of_modify() const
  {
    return lammps_id_count(lmp, "fix") == modify->nfix && lammps_id_count(lmp, "compute") == modify->ncompute;
  }
};

}    // namespace nosquish
}    // namespace

#endif
