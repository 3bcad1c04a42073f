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
  double reach;      // the largest of all molecules
  int most_sites;    // and the largest number of atoms

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
    reach = -1.0;
    for (int i = 0; i < atom->nlocal; i++) measure(i);
    return *reduce(&reach, 1, MPI_MAX) < 0.0 ? "no rank holds all atoms of a molecule" : "";
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

  // Measure the molecule whose site 0 is atom i, if all its atoms are on this rank.

  void measure(int i)
  {
    double near[MOST_SITES][3], *x[MOST_SITES], row[3 * (MOST_SITES + 1)];
    int numbers[MOST_SITES];
    for (int a = 0; a < sites(i); a++) {
      const int j = site(i) ? -1 : atom->map(atom->tag[i] + a);
      if (j < 0 || j >= atom->nlocal) return;
      domain->remap_near(std::copy_n(atom->x[j], 3, near[a]) - 3, atom->x[i]);
      x[numbers[a] = a] = near[a];
    }
    reach = std::max(reach, place(x, numbers, sites(i), row));
  }
};

}    // namespace nosquish
}    // namespace

#endif
