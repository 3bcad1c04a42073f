/* Whether LAMMPS's objects lie in memory as the headers said with which this was compiled. Another build of the same version, with
   a patch, may have other members, and nothing in its version number tells. So what LAMMPS's library interface gives is compared
   with what this code finds by itself: addresses, which are safe to compare whatever they are, before anything behind them.

   What cannot be compared, because the library interface tells nothing of it: the virials, tail corrections and flags in Pair, Bond,
   Angle, Dihedral, Improper and KSpace, and where their methods are (used at constant pressure and by hybrid Monte Carlo); members
   of Output behind the number of dumps; Group, Input and Error. Timer is compared where it is used: see end_of_step. */

#ifndef FIX_NOSQUISH_LAYOUT_H
#define FIX_NOSQUISH_LAYOUT_H

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
#include "universe.h"
#include "update.h"

#include <cstring>
#include <dlfcn.h>
#include <new>
#include <string>
#include <vector>

namespace nosquish {
using namespace LAMMPS_NS;

class Layout {
 public:
  explicit Layout(LAMMPS *lmp) : lmp(lmp) {}

  // LAMMPS's own class, by which all others are found.

  bool lammps() const
  {
    return lmp->num_ver == lammps_version(lmp) && lmp->world == MPI_Comm_f2c(lammps_get_mpi_comm(lmp));
  }

  // Those by which a style is entered: all that is needed as LAMMPS starts, whether a script uses this plugin or not.

  bool styles() const { return lammps() && modify(); }

  // The first class that is another than LAMMPS's, on any rank; null for none. Collective.

  const char *differs() const
  {
    using Check = bool (Layout::*)() const;
    const std::vector<std::pair<const char *, Check>> classes = {
        {"LAMMPS", &Layout::lammps}, {"Update", &Layout::update}, {"Domain", &Layout::domain}, {"Force", &Layout::force},
        {"Comm", &Layout::comm},     {"Neighbor", &Layout::neighbor}, {"Atom", &Layout::atom}, {"Modify", &Layout::modify},
        {"Compute", &Layout::compute}, {"Fix", &Layout::fix}, {"Universe", &Layout::universe}, {"Output", &Layout::output}};
    int first = 0, of_all = 0;
    const int n = classes.size();
    while (first < n && (this->*classes[first].second)()) first++;
    MPI_Allreduce(&first, &of_all, 1, MPI_INT, MPI_MIN, MPI_Comm_f2c(lammps_get_mpi_comm(lmp)));
    return of_all < n ? classes[of_all].first : nullptr;
  }

 private:
  LAMMPS *lmp;

  // What an older LAMMPS does not tell counts as alike.

  bool at(const char *name, const void *own) const
  {
    const void *told = lammps_extract_global(lmp, name);
    return !told || told == own;
  }

  bool is(const char *name, int own) const
  {
    const int told = lammps_extract_setting(lmp, name);
    return told < 0 || told == own;
  }

  bool array(const char *name, const void *own) const
  {
    const void *told = lammps_extract_atom(lmp, name);
    return !told || told == own;
  }

  bool update() const
  {
    const auto all = lmp->update;
    return at("dt", &all->dt) && at("ntimestep", &all->ntimestep) && at("atime", &all->atime) &&
        at("eflag_global", &all->eflag_global) && at("vflag_global", &all->vflag_global) && at("vflag_atom", &all->vflag_atom) &&
        at("units", all->unit_style);
  }

  bool domain() const
  {
    const auto all = lmp->domain;
    return at("periodicity", all->periodicity) && at("triclinic", &all->triclinic) && at("boxlo", all->boxlo) &&
        at("boxhi", all->boxhi) && at("sublo", all->sublo) && at("subhi", all->subhi) && at("sublo_lambda", all->sublo_lamda) &&
        at("subhi_lambda", all->subhi_lamda) && at("xy", &all->xy) && at("xz", &all->xz) && at("yz", &all->yz) &&
        at("xlattice", &all->lattice->xlattice) && is("dimension", all->dimension);
  }

  bool force() const
  {
    const auto all = lmp->force;
    return at("boltz", &all->boltz) && at("qelectron", &all->qelectron) && at("special_lj", all->special_lj) &&
        at("special_coul", all->special_coul) && is("newton_pair", all->newton_pair) && at("pair_style", all->pair_style) &&
        at("kspace_style", all->kspace_style);
  }

  bool comm() const
  {
    const auto all = lmp->comm;
    return at("procgrid", all->procgrid) && is("world_rank", all->me) && is("world_size", all->nprocs) &&
        is("ghost_velocity", all->ghost_velocity);
  }

  bool neighbor() const
  {
    const auto all = lmp->neighbor;
    return is("neigh_every", all->every) && is("neigh_delay", all->delay) && is("neigh_dist_check", all->dist_check) &&
        is("nbondlist", all->nbondlist) && at("neigh_bondlist", all->bondlist);
  }

  bool atom() const
  {
    const auto all = lmp->atom;
    return at("natoms", &all->natoms) && at("nlocal", &all->nlocal) && at("nghost", &all->nghost) && at("q_flag", &all->q_flag) &&
        at("map_style", &all->map_style) && at("sortfreq", &all->sortfreq) && at("nextsort", &all->nextsort) &&
        is("nmax", all->nmax) && is("ntypes", all->ntypes) && is("torque_flag", all->torque_flag) && array("mass", all->mass) &&
        array("x", all->x) && array("v", all->v) && array("f", all->f) && array("mask", all->mask) && array("type", all->type) &&
        array("rmass", all->rmass) && array("omega", all->omega) && array("torque", all->torque) &&
        array("angmom", all->angmom) && array("mu", all->mu) && array("ellipsoid", all->ellipsoid) && array("line", all->line) &&
        array("tri", all->tri);
  }

  bool modify() const
  {
    return lammps_id_count(lmp, "fix") == lmp->modify->nfix && lammps_id_count(lmp, "compute") == lmp->modify->ncompute;
  }

  bool universe() const { return is("universe_rank", lmp->universe->me) && is("universe_size", lmp->universe->nprocs); }

  bool output() const
  {
    return is("thermo_every", lmp->output->thermo_every) && lammps_id_count(lmp, "dump") == lmp->output->ndump;
  }

  // LAMMPS makes a few computes by itself, of known kinds.

  bool compute() const
  {
    for (int n = 0; n < lmp->modify->ncompute; n++) {
      char name[64] = "";
      if (!lammps_id_name(lmp, "compute", n, name, sizeof name)) continue;
      const auto one = lmp->modify->compute[n];
      const bool pressure = strcmp(name, "thermo_press") == 0, energy = strcmp(name, "thermo_pe") == 0;
      if (strncmp(one->id, name, sizeof name - 1) != 0) return false;
      if ((pressure || energy) && (one->pressflag != pressure || one->peflag != energy)) return false;
    }
    return true;
  }

  // Fix is what this plugin's fix derives from: LAMMPS makes its part of the object, and calls its methods by their numbers.

  struct Probe : Fix {
    Probe(LAMMPS *lmp, char **words) : Fix(lmp, 3, words) {}
    int setmask() override { return 0; }

    static const int UNWRITTEN = 0x5a5a5a5a;
    bool whole() const { return copymode != UNWRITTEN && dynamic != UNWRITTEN; }    // LAMMPS has written the last members

    // An entry of LAMMPS's table that is here under another number tells of a method before it that is not in both.

    bool same_methods() const
    {
      const auto symbol = static_cast<void **>(dlsym(RTLD_DEFAULT, "_ZTVN9LAMMPS_NS3FixE"));
      const auto own = *reinterpret_cast<void *const *const *>(this);
      const auto last = &Probe::memory_usage;    // as compilers have it: one more than its place in the table
      std::uintptr_t offset = 0;
      memcpy(&offset, &last, sizeof offset);
      const size_t n = (offset - 1) / sizeof(void *) + 1;
      for (size_t i = 0; symbol && i < n; i++)
        for (size_t j = 0; j < n; j++)
          if (own[j] == symbol[2 + i] && own[i] != symbol[2 + i]) return false;
      return true;
    }
  };

  bool fix() const
  {
    const size_t size = sizeof(Probe), room = size + 4096;
    std::vector<char> place(room, Probe::UNWRITTEN & 0xff);
    std::string id = "layout", group = "all", style = "python/move";
    char *words[] = {&id[0], &group[0], &style[0]};
    const auto probe = new (place.data()) Probe(lmp, words);
    bool alike = probe->whole() && probe->same_methods();
    for (size_t k = size; k < room; k++) alike &= place[k] == place[room - 1];
    if (alike) probe->~Probe();    // else who knows what it frees
    return alike;
  }
};

}    // namespace nosquish

#endif
