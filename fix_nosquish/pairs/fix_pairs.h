/* Fix nosquish/pairs: forces between small molecules, for molecules of a few species, in place of LAMMPS's loop over pairs of atoms. */

#ifndef FIX_NOSQUISH_FIX_PAIRS_H
#define FIX_NOSQUISH_FIX_PAIRS_H

#include "kernel.h"

#include "compute.h"
#include "fix.h"
#include "force.h"
#include "group.h"
#include "kspace.h"
#include "lammps_versions.h"
#include "modify.h"
#include "neigh_list.h"
#include "styles.h"
#include "update.h"

#include <cstdio>

namespace LAMMPS_NS {
class NeighRequest {    // whose header is not installed
 public:
  void apply_flags(int);
};
}    // namespace LAMMPS_NS

namespace {
namespace nosquish {

// The pair style stays LAMMPS's, with its coefficients. Its neighbor list becomes one that is made only when asked for, so LAMMPS makes
// none and computes no pair; this fix adds the forces before LAMMPS sends those of ghost atoms back. In steps in which energies or stress
// of each atom are asked for, the list is made, and the style computes them.

class FixPairs : public Fix {
 public:
  FixPairs(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg), ids(lmp), list(lmp, ids)
  {
    mixed = narg == 5 && strcmp(arg[4], "mixed") == 0;
    if (narg != 3 && (narg != 5 || strcmp(arg[3], "precision") != 0 || (!mixed && strcmp(arg[4], "double") != 0)))
      end_on_all(lmp, problem(this, "'precision double' or 'precision mixed' can follow the style, and nothing else"), 3);
    if (igroup) end_on_all(lmp, problem(this, "its group must be 'all'"), 1);
    if (!modify->get_fix_by_style("^nosquish/pairs").empty()) end_on_all(lmp, problem(this, "there is another fix of this style"), 2);
  }

  int setmask() override
  {
    return FixConst::PRE_FORCE | FixConst::PRE_REVERSE | FixConst::MIN_PRE_FORCE | FixConst::MIN_PRE_REVERSE;
  }

  void init() override
  {
    pair = force->pair;
    // no step yet: LAMMPS begins with 0, which would mean that step 0 has energies of each atom
    update->eflag_atom = update->vflag_atom = -1;
    obstacle = find_obstacle();
    if (obstacle.empty()) {
      // a rerun begins again with each frame, and has no requests then
      if (const auto request = neighbor->find_request(pair)) request->apply_flags(NeighConst::REQ_OCCASIONAL);
      comm->cutghostuser = std::max(comm->cutghostuser, list.ghost_cutoff(pair->cutforce));
      // forces of ghost atoms are sent back with 'newton off', too, and need room
      if (!force->newton) pair->comm_reverse_off = std::max(pair->comm_reverse_off, 3);
    }
    const std::string text = obstacle.empty() ? problem(this, "computes pair_style " + std::string(force->pair_style) + (mixed ? " in mixed precision\n" : "\n"))
                                              : "WARNING: " + problem(this, "LAMMPS computes the pairs: " + obstacle + "\n");
    if (comm->me == 0 && text != std::exchange(logged, text)) utils::logmesg(lmp, text);
  }

  void setup_pre_force(int vflag) override { pre_force(vflag); }
  void min_pre_force(int vflag) override { pre_force(vflag); }
  void setup_pre_reverse(int eflag, int vflag) override { pre_reverse(eflag, vflag); }
  void min_pre_reverse(int eflag, int vflag) override { pre_reverse(eflag, vflag); }

  // With a list LAMMPS computes the pairs of this step.

  void pre_force(int) override
  {
    per_atom = update->eflag_atom == update->ntimestep || update->vflag_atom == update->ntimestep;
    if (!per_atom || !obstacle.empty()) return;
    neighbor->lastcall = update->ntimestep + 1;    // later than any list: each such step needs a list of its own positions
    neighbor->build_one(pair->list);
  }

  void pre_reverse(int eflag, int vflag) override
  {
    if (!obstacle.empty()) return;
    if (neighbor->ago == 0) build();    // LAMMPS has made new lists
    else if (!per_atom) list.update();
    if (per_atom) {
      pair->list->inum = 0;
      return;
    }
    list.forces.assign(list.rows.size(), 0.0);
    const Energies energies = mixed ? compute_forces(list, of_sites_rounded.data()) : compute_forces(list, of_sites.data());
    if (eflag) pair->eng_vdwl += energies.lj, pair->eng_coul += energies.coul;
    if (!force->newton && atom->nghost) std::fill_n(atom->f[atom->nlocal], 3 * (size_t) atom->nghost, 0.0);    // these atoms have no forces yet
    double virial[6] = {};
    add_between(virial);
    add_within(eflag, virial);
    if (!force->newton) comm->reverse_comm();
    for (const int k : {0, 1, 2, 3, 4, 5}) pair->virial[k] += vflag & (VIRIAL_PAIR | VIRIAL_FDOTR) ? virial[k] : 0.0;
  }

 private:
  MoleculeIds ids;
  MoleculeList list;
  Pair *pair = nullptr;
  std::string obstacle = "no run has begun", logged;    // why LAMMPS computes the pairs; what the log has last
  bool mixed, per_atom = false;
  std::vector<PairFunction<double>> of_types, of_sites;    // of types i and j: [i * (ntypes + 1) + j]; of sites: see kernel.h
  std::vector<PairFunction<float>> of_sites_rounded;

  struct Within {    // two atoms of a molecule whose pair is in LAMMPS's lists, and its factors of special_bonds
    int i, j;
    double lj, coul;
  };
  std::vector<Within> within;

  void add_to(int i, const double *x, const double *f, double factor, double *virial)
  {
    double r[3];    // from the middle of the box: in mixed precision the forces add up to zero only within rounding
    for (const int d : {0, 1, 2}) {
      r[d] = x[d] - 0.5 * (domain->boxlo[d] + domain->boxhi[d]);
      atom->f[i][d] += factor * f[d], virial[d] += factor * r[d] * f[d];
    }
    virial[3] += factor * r[0] * f[1], virial[4] += factor * r[0] * f[2], virial[5] += factor * r[1] * f[2];
  }

  void add_between(double *virial)
  {
    for (int m = 0; m < list.all; m++)
      for (int a = 0; a < list.species[list.kind[m]].sites; a++) {
        const size_t place = (size_t) m * list.stride + 3 * (a + 1);
        add_to(list.atoms_of(m)[a], &list.rows[place], &list.forces[place], 1.0, virial);
      }
  }

  // Pairs of atoms of a molecule that special_bonds and neigh_modify exclude leave in: the style computes them one by one.

  void add_within(int eflag, double *virial)
  {
    for (const auto &[i, j, lj, coul] : within) {
      const int itype = atom->type[i], jtype = atom->type[j];
      double r[3], over_r, ignored;
      for (const int d : {0, 1, 2}) r[d] = atom->x[i][d] - atom->x[j][d];
      const double r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
      if (r2 >= pair->cutsq[itype][jtype]) continue;
      const double energy = pair->single(i, j, itype, jtype, r2, coul, lj, over_r);
      const double coul_energy = eflag ? pair->single(i, j, itype, jtype, r2, coul, 0.0, ignored) : 0.0;
      if (eflag) pair->eng_coul += coul_energy, pair->eng_vdwl += energy - coul_energy;
      add_to(i, atom->x[i], r, over_r, virial);
      add_to(j, atom->x[j], r, -over_r, virial);
    }
  }

  void build()
  {
    list.build(pair->cutforce);
    MPI_Allreduce(MPI_IN_PLACE, &list.broken, 1, MPI_LMP_TAGINT, MPI_MAX, world);
    if (list.broken)
      end_on_all(lmp, problem(this, "molecule " + std::to_string(list.broken) + " is not whole, has grown since the run "
                                    "began, or is of more than " + std::to_string(MOST_SPECIES) + " kinds: use this fix for molecules "
                                    "that are held by fix nosquish, rigid or shake"));
    const size_t n = list.species.size(), types = atom->ntypes + 1;
    of_sites.resize(n * n * MOST_SITES * MOST_SITES);
    for (size_t k = 0; k < of_sites.size(); k++) {
      const size_t a = k / MOST_SITES % MOST_SITES, b = k % MOST_SITES, st = k / MOST_SITES / MOST_SITES;
      const Species &s = list.species[st / n], &t = list.species[st % n];
      of_sites[k] = of_types[s.type[a] * types + t.type[b]];
      of_sites[k].charge *= s.charge[a] * t.charge[b];
    }
    if (mixed) of_sites_rounded.assign(of_sites.begin(), of_sites.end());
    within.clear();
    for (int i = 0; i < atom->nlocal && !neighbor->nex_mol; i++)    // which excludes pairs within molecules: see find_obstacle
      for (int next = 1; next < ids.sites(i) - ids.site(i); next++) {
        const int which = special(i, atom->tag[i] + next), flag = which ? neighbor->special_flag[which] : 1;
        if (flag) within.push_back({i, domain->closest_image(i, atom->map(atom->tag[i] + next)),
                                    flag == 2 ? force->special_lj[which] : 1.0, flag == 2 ? force->special_coul[which] : 1.0});
      }
  }

  // 1, 2, 3 if this is a 1-2, 1-3, 1-4 neighbor of an owned atom, and 0 if it is none.

  int special(int i, tagint other) const
  {
    const tagint *its = atom->special[i];
    const int *numbers = atom->nspecial[i], k = (int) (std::find(its, its + numbers[2], other) - its);
    return k == numbers[2] ? 0 : 1 + (k >= numbers[0]) + (k >= numbers[1]);
  }

  // What prevents this fix from computing the pairs, or "". Collective.

  std::string find_obstacle()
  {
    const std::string style = force->pair_style ? force->pair_style : "none";
    const std::string plain = style.substr(0, style.find("/opt"));
    const char *known[] = {"lj/cut", "lj/cut/coul/cut", "lj/cut/coul/long", "lj/charmm/coul/long"};
    if (std::find(std::begin(known), std::end(known), plain) == std::end(known))
      return "pair_style " + style + " is not lj/cut, lj/cut/coul/cut, lj/cut/coul/long or lj/charmm/coul/long";
    if (update->whichflag == 1 && strcmp(update->integrate_style, "verlet") != 0) return "it needs run_style verlet";
    if (!force->newton && utils::strmatch(atom->atom_style, "^hybrid")) return "it cannot be used with 'newton off' and 'atom_style hybrid'";
    if (!pair->compute_flag || comm->mode != Comm::SINGLE || atom->firstgroupname || neighbor->includegroup)
      return "it cannot be used with 'pair_modify compute no', 'comm_modify mode multi', 'atom_modify first' or 'neigh_modify include'";
    const bool one = neighbor->nex_mol == 1 && neighbor->ex_mol_intra[0] && group->count(neighbor->ex_mol_group[0]) == atom->natoms;
    if (neighbor->nex_type || neighbor->nex_group || (neighbor->nex_mol && !one)) return "'neigh_modify exclude' excludes other pairs than all within molecules";
    const char *direct[] = {"^adapt", "^gcmc",    "^gemc",       "^widom",   "^atom/swap", "^mol/swap", "^neighbor/swap", "^sgcmc",
                            "^fep",   "^numdiff", "^born/matrix", "^polarize", "^tune/", "^qeq/", "^acks2/", "^electrode/",
                            "/tally$", "^charge/regulation", "^deposit", "^pour", "^bond/react"};
    for (const char *pattern : direct) {
      for (const auto &fix : modify->get_fix_by_style(pattern)) return "fix " + std::string(fix->style) + " calls the pair style, or changes it, charges or molecules";
      for (const auto &compute : modify->get_compute_list())
        if (utils::strmatch(compute->style, pattern)) return "compute " + std::string(compute->style) + " calls the pair style";
    }
    list.species.clear();
    const std::string found = ids.find();
    return found.empty() ? read_functions(plain) : found;
  }

  // Find the functions of all pairs of types; returns "" if they are those of the style.

  std::string read_functions(const std::string &style)
  {
    double inner = 0.0, difference = 0.0;
    if (style == "lj/charmm/coul/long") {    // what the style writes to restart files begins with it
      char text[1024] = {};
      FILE *file = fmemopen(text, sizeof(text), "w");
      pair->write_restart_settings(file);
      fclose(file);
      memcpy(&inner, text, sizeof(inner));
    }
    const int types = atom->ntypes + 1, tables = std::exchange(pair->ncoultablebits, 0);
    of_types.assign(types * types, {});
    for (int i = 1; i < types; i++)
      for (int j = i; j < types; j++) {
        StyleProbe probe(pair, atom->q_flag ? atom->q : nullptr, i, j);
        const PairFunction<double> function = of_types[i * types + j] = of_types[j * types + i] =
            probe.function(force->qqrd2e, force->kspace ? force->kspace->g_ewald : 0.0, inner * inner);
        difference += mixed ? probe.difference<float>(function) : probe.difference<double>(function);    // also if it is no number
      }
    pair->ncoultablebits = tables;
    return difference < (mixed ? 1e-3 : 1e-9) ? "" : "its results differ from those of the pair style, or are out of range in this precision";
  }
};

}    // namespace nosquish
}    // namespace

#endif
