/* Whether LAMMPS's objects lie in memory as the headers said with which this was compiled. Another build of the same version, with
   a patch, may have other members, and nothing in its version number tells. So what LAMMPS's library interface gives is compared
   with what this code finds by itself: addresses, which are safe to compare whatever they are, before anything behind them.

   What cannot be compared, because the library interface tells nothing of it: members and methods of Fix; the virials, tail
   corrections and flags in Pair, Bond, Angle, Dihedral, Improper and KSpace, and where their methods are (used at constant pressure
   and by hybrid Monte Carlo); members of Output behind the number of dumps; Group, Input and Error. */

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

#include <cstring>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace {
namespace nosquish {

class Layout : private Pointers {
 public:
  using Pointers::Pointers;

  // LAMMPS's own class, by which all others are found.

  bool lammps() const { return lmp->num_ver == lammps_version(lmp) && world == MPI_Comm_f2c(lammps_get_mpi_comm(lmp)); }

  // Those by which a style is entered: all that is needed as LAMMPS starts, whether a script uses this plugin or not.

  bool styles() const { return lammps() && lists_of_modify(); }

  // The first class that is another than LAMMPS's, on any rank; null for none. Collective.

  const char *differs() const
  {
    const std::vector<std::pair<const char *, std::function<bool()>>> classes = {
        {"LAMMPS", [this] { return lammps(); }},
        {"Update",
         [this] {
           return at("dt", &update->dt) && at("ntimestep", &update->ntimestep) && at("atime", &update->atime) &&
               at("eflag_global", &update->eflag_global) && at("vflag_global", &update->vflag_global) &&
               at("vflag_atom", &update->vflag_atom) && at("units", update->unit_style);
         }},
        {"Domain",
         [this] {
           return at("periodicity", domain->periodicity) && at("triclinic", &domain->triclinic) && at("boxlo", domain->boxlo) &&
               at("boxhi", domain->boxhi) && at("sublo", domain->sublo) && at("subhi", domain->subhi) &&
               at("sublo_lambda", domain->sublo_lamda) && at("subhi_lambda", domain->subhi_lamda) && at("xy", &domain->xy) &&
               at("xz", &domain->xz) && at("yz", &domain->yz) && at("xlattice", &domain->lattice->xlattice) &&
               is("dimension", domain->dimension);
         }},
        {"Force",
         [this] {
           return at("boltz", &force->boltz) && at("qelectron", &force->qelectron) && at("special_lj", force->special_lj) &&
               at("special_coul", force->special_coul) && is("newton_pair", force->newton_pair) &&
               at("pair_style", force->pair_style) && at("kspace_style", force->kspace_style);
         }},
        {"Comm",
         [this] {
           return at("procgrid", comm->procgrid) && is("world_rank", comm->me) && is("world_size", comm->nprocs) &&
               is("ghost_velocity", comm->ghost_velocity);
         }},
        {"Neighbor",
         [this] {
           return is("neigh_every", neighbor->every) && is("neigh_delay", neighbor->delay) &&
               is("neigh_dist_check", neighbor->dist_check) && is("nbondlist", neighbor->nbondlist) &&
               at("neigh_bondlist", neighbor->bondlist);
         }},
        {"Atom",
         [this] {
           return at("natoms", &atom->natoms) && at("nlocal", &atom->nlocal) && at("nghost", &atom->nghost) &&
               at("q_flag", &atom->q_flag) && at("map_style", &atom->map_style) && at("sortfreq", &atom->sortfreq) &&
               at("nextsort", &atom->nextsort) && is("nmax", atom->nmax) && is("ntypes", atom->ntypes) &&
               is("torque_flag", atom->torque_flag) && array("mass", atom->mass) && array("x", atom->x) && array("v", atom->v) &&
               array("f", atom->f) && array("mask", atom->mask) && array("type", atom->type) && array("rmass", atom->rmass) &&
               array("omega", atom->omega) && array("torque", atom->torque) && array("angmom", atom->angmom) &&
               array("mu", atom->mu) && array("ellipsoid", atom->ellipsoid) && array("line", atom->line) && array("tri", atom->tri);
         }},
        {"Modify", [this] { return lists_of_modify(); }},
        {"Compute", [this] { return computes(); }},
        {"Universe", [this] { return is("universe_rank", universe->me) && is("universe_size", universe->nprocs); }},
        {"Output",
         [this] { return is("thermo_every", output->thermo_every) && lammps_id_count(lmp, "dump") == output->ndump; }},
    };
    int first = 0, of_all = 0;
    const int n = classes.size();
    while (first < n && classes[first].second()) first++;
    MPI_Allreduce(&first, &of_all, 1, MPI_INT, MPI_MIN, MPI_Comm_f2c(lammps_get_mpi_comm(lmp)));
    return of_all < n ? classes[of_all].first : nullptr;
  }

 private:
  // What an older LAMMPS does not tell counts as alike.

  bool at(const char *name, const void *own) const { return is_alike(lammps_extract_global(lmp, name), own); }
  bool array(const char *name, const void *own) const { return is_alike(lammps_extract_atom(lmp, name), own); }
  static bool is_alike(const void *told, const void *own) { return !told || told == own; }

  bool is(const char *name, int own) const
  {
    const int told = lammps_extract_setting(lmp, name);
    return told < 0 || told == own;
  }

  bool lists_of_modify() const
  {
    return lammps_id_count(lmp, "fix") == modify->nfix && lammps_id_count(lmp, "compute") == modify->ncompute;
  }

  // LAMMPS makes a few computes by itself, of known kinds.

  bool computes() const
  {
    for (int n = 0; n < modify->ncompute; n++) {
      char name[64] = "";
      if (!lammps_id_name(lmp, "compute", n, name, sizeof name)) continue;
      const auto one = modify->compute[n];
      const bool pressure = strcmp(name, "thermo_press") == 0, energy = strcmp(name, "thermo_pe") == 0;
      if (strncmp(one->id, name, sizeof name - 1) != 0) return false;
      if ((pressure || energy) && (one->pressflag != pressure || one->peflag != energy)) return false;
    }
    return true;
  }
};

}    // namespace nosquish
}    // namespace

#endif
