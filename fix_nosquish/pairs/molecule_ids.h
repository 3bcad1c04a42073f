/* Which atoms are a molecule: those with the same molecule-ID, if their IDs are consecutive. */

#ifndef FIX_NOSQUISH_MOLECULE_IDS_H
#define FIX_NOSQUISH_MOLECULE_IDS_H

#include "atom.h"
#include "domain.h"
#include "pointers.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace {
namespace nosquish {
using namespace LAMMPS_NS;

constexpr int MOST_SITES = 16;

// Write the centre of a molecule's sites and the positions of the sites; returns the reach, the largest distance of a site from the centre.

inline double place(const double *const *x, const int *atoms, int sites, double *centre)
{
  double *const positions = centre + 3;
  for (const int d : {0, 1, 2}) {
    double sum = 0.0;
    for (int a = 0; a < sites; a++) sum += positions[3 * a + d] = x[atoms[a]][d];
    centre[d] = sum / sites;
  }
  double furthest2 = 0.0;
  for (const double *r = positions; r < positions + 3 * sites; r += 3) {
    const double dx = r[0] - centre[0], dy = r[1] - centre[1], dz = r[2] - centre[2];
    furthest2 = std::max(furthest2, dx * dx + dy * dy + dz * dz);
  }
  return std::sqrt(furthest2);
}

class MoleculeIds : protected Pointers {
 public:
  using Pointers::Pointers;
  double reach;      // a bound for all molecules
  int most_sites;    // the largest number of atoms

  int site(int i) const { return (int) (atom->tag[i] - first[atom->molecule[i]]); }
  int sites(int i) const { return size[atom->molecule[i]]; }

  // Find the molecules; returns what prevents it, or "". Collective.

  std::string find()
  {
    if (atom->molecular != Atom::MOLECULAR || !atom->tag_enable || atom->map_style == Atom::MAP_NONE)
      return "it needs molecule-IDs and a map of atoms, as 'atom_style full' has them";
    const tagint *molecule = atom->molecule;
    tagint most = 0;
    for (int i = 0; i < atom->nlocal; i++) most = std::max(most, molecule[i] > 0 ? molecule[i] : MAXTAGINT);
    if (*reduce(&most, 1, MPI_MAX) > atom->natoms) return "atoms have molecule-ID 0, or one larger than the number of atoms";
    first.assign(most + 1, MAXTAGINT);
    size.assign(most + 1, 0);
    for (int i = 0; i < atom->nlocal; i++) first[molecule[i]] = std::min(first[molecule[i]], atom->tag[i]), size[molecule[i]]++;
    reduce(first.data(), first.size(), MPI_MIN);
    reduce(size.data(), size.size(), MPI_SUM);
    most_sites = *std::max_element(size.begin(), size.end());
    int other = 0;
    for (int i = 0; i < atom->nlocal; i++) other |= sites(i) > MOST_SITES || site(i) >= sites(i);
    if (*reduce(&other, 1, MPI_MAX))
      return "a molecule has more than " + std::to_string(MOST_SITES) + " atoms, or its atoms do not have consecutive IDs";
    measure();
    for (const int d : {0, 1, 2})
      if (domain->periodicity[d] && reach > 0.4 * domain->prd[d]) return "a molecule is so long that it can touch its own image";
    return "";
  }

 private:
  std::vector<tagint> first;    // by molecule-ID: the lowest ID of its atoms, and their number
  std::vector<int> size;

  template <typename T> T *reduce(T *values, size_t n, MPI_Op operation) const
  {
    const MPI_Datatype type = std::is_same<T, double>::value ? MPI_DOUBLE : sizeof(T) == 8 ? MPI_INT64_T : MPI_INT;
    MPI_Allreduce(MPI_IN_PLACE, values, (int) n, type, operation, world);
    return values;
  }

  // Find a bound of the reach from the distances to site 0, which may be on another rank: the centre of n sites, at most d from site 0,
  // is at most 2 d (n - 1) / n from each.

  void measure()
  {
    std::vector<double> site0(3 * size.size(), 0.0);
    for (int i = 0; i < atom->nlocal; i++)
      if (site(i) == 0) std::copy_n(atom->x[i], 3, &site0[3 * (size_t) atom->molecule[i]]);
    reduce(site0.data(), site0.size(), MPI_SUM);
    reach = 0.0;
    for (int i = 0; i < atom->nlocal; i++) {
      double r[3] = {atom->x[i][0], atom->x[i][1], atom->x[i][2]}, *from = &site0[3 * (size_t) atom->molecule[i]];
      domain->remap_near(r, from);
      reach = std::max(reach, std::hypot(r[0] - from[0], r[1] - from[1], r[2] - from[2]) * 2.0 * (sites(i) - 1) / sites(i));
    }
    reduce(&reach, 1, MPI_MAX);
  }
};

}    // namespace nosquish
}    // namespace

#endif
