/* Pairs of molecules that can come within the cutoff until LAMMPS makes its lists anew. */

#ifndef FIX_NOSQUISH_MOLECULE_LIST_H
#define FIX_NOSQUISH_MOLECULE_LIST_H

#include "lanes.h"
#include "molecule_ids.h"

#include "neighbor.h"

#include <array>

namespace {
namespace nosquish {

constexpr size_t MOST_SPECIES = 16;

struct Species {
  int sites;
  std::array<int, MOST_SITES> type;
  std::array<double, MOST_SITES> charge;
};

// Owned molecules, whose site 0 is an atom of this rank, come first, then those whose site 0 is a ghost atom. A row holds the centre of
// a molecule's sites and the sites, in the box's coordinates.

class MoleculeList : protected Pointers {
 public:
  MoleculeList(LAMMPS *lmp, const MoleculeIds &ids) : Pointers(lmp), ids(ids) {}

  std::vector<Species> species;    // with the same types and charges of sites
  int owned = 0, all = 0, stride = 0;
  tagint broken = 0;                  // the ID of a molecule that is not whole, has grown beyond the bound, or is of too many species
  std::vector<int> kind, atoms;       // the species, and atoms[m * ids.most_sites + site]
  std::vector<double> rows, forces;
  double reach = 0.0;                 // the largest distance of a site from the centre now
  std::vector<int> partners;          // of an owned molecule m, those of species s from start[m * species + s] on
  std::vector<size_t> start;
  std::vector<int> near;              // room for indices of all molecules
  double cutoff = 0.0;

  double *row(int m) { return &rows[(size_t) m * stride]; }
  int *atoms_of(int m) { return &atoms[(size_t) m * ids.most_sites]; }

  // The distance from a rank's part of the box within which all molecules must be known whole.

  double ghost_cutoff(double cutoff) const { return cutoff + neighbor->skin + 4.0 * ids.reach; }

  void build(double cutoff)
  {
    this->cutoff = cutoff;
    collect();
    near.resize(all + LANES<float>);
    limit = cutoff + neighbor->skin + 2.0 * reach;
    sort_into_bins();
    find_partners();
  }

  // Copy the positions from LAMMPS.

  void update()
  {
    reach = 0.0;
    for (int m = 0; m < all; m++)
      reach = std::max(reach, place(atom->x, atoms_of(m), species[kind[m]].sites, row(m)));
  }

 private:
  const MoleculeIds &ids;

  // Find the atoms of all molecules, but not of those below all owned ones: see find_partners. Ghost molecules that are not whole are
  // farther than any cutoff: see ghost_cutoff.

  void collect()
  {
    stride = 3 * (ids.most_sites + 1);
    reach = broken = owned = all = 0;
    kind.clear();
    rows.assign(stride, 0.0);    // the last is no molecule
    double lowest = atom->nlocal ? atom->x[0][2] : 0.0;
    for (int i = 0; i < atom->nlocal + atom->nghost; i++) {
      if (i < atom->nlocal) lowest = std::min(lowest, atom->x[i][2]);
      if (ids.site(i) || atom->x[i][2] < lowest - 2.1 * ids.reach - 1e-6 * cutoff) continue;
      atoms.resize((size_t) (all + 1) * ids.most_sites);
      rows.resize((size_t) (all + 2) * stride);
      int *its = atoms_of(all);
      its[0] = i;
      bool whole = true;
      for (int a = 1; a < ids.sites(i); a++) {
        const int j = atom->map(atom->tag[i] + a);
        its[a] = j < 0 ? i : domain->closest_image(i, j);
        whole &= j >= 0;
      }
      const double its_reach = place(atom->x, its, ids.sites(i), row(all));
      whole &= its_reach < ids.reach + 1e-6;
      if ((!whole && i < atom->nlocal) || species.size() > MOST_SPECIES) broken = atom->molecule[i];
      if (!whole) continue;
      kind.push_back(species_of(its, ids.sites(i)));
      reach = std::max(reach, its_reach);
      all++;
      if (i < atom->nlocal) owned = all;
    }
  }

  int species_of(const int *its, int sites)
  {
    Species one = {sites, {}, {}};
    for (int a = 0; a < sites; a++) one.type[a] = atom->type[its[a]], one.charge[a] = atom->q_flag ? atom->q[its[a]] : 0.0;
    const size_t s = std::find_if(species.begin(), species.end(), [&](const Species &other) {
      return other.sites == sites && other.type == one.type && other.charge == one.charge;
    }) - species.begin();
    if (s == species.size()) species.push_back(one);
    return (int) s;
  }

  // Molecules in order of species and bins, with x as the fastest coordinate, so that a row of bins is a stretch of this order.

  double limit = 0.0, low[3], per_length[3];
  int bins[3];
  std::vector<size_t> bin_start;
  struct Candidate {
    double x, y, z;
    int molecule;
    tagint id;
  };
  std::vector<Candidate> ordered;

  size_t row_of_bins(size_t kind, int z, int y) const { return ((kind * bins[2] + z) * bins[1] + y) * bins[0]; }
  int bin(double x, int d) const { return std::min(std::max((int) ((x - low[d]) * per_length[d]), 0), bins[d] - 1); }

  void sort_into_bins()
  {
    for (const int d : {0, 1, 2}) {
      double high = low[d] = rows[d];
      for (int m = 0; m < all; m++) low[d] = std::min(low[d], row(m)[d]), high = std::max(high, row(m)[d]);
      bins[d] = 1 + (int) std::min(3.0 * (high - low[d]) / limit, std::cbrt(all));
      per_length[d] = bins[d] / (high - low[d] + 1e-10);
    }
    std::vector<size_t> bin_of(all);
    bin_start.assign(species.size() * bins[2] * bins[1] * bins[0] + 1, 0);
    for (int m = 0; m < all; m++) {
      bin_of[m] = (row_of_bins(kind[m], bin(row(m)[2], 2), bin(row(m)[1], 1)) + bin(row(m)[0], 0));
      bin_start[bin_of[m] + 1]++;
    }
    for (size_t b = 1; b < bin_start.size(); b++) bin_start[b] += bin_start[b - 1];
    std::vector<size_t> next = bin_start;
    ordered.resize(all);
    for (int m = 0; m < all; m++) ordered[next[bin_of[m]]++] = {row(m)[0], row(m)[1], row(m)[2], m, atom->molecule[*atoms_of(m)]};
  }

  // Each pair once, for the molecule with the lower z, or y, or x, on the rank that owns it. Coordinates that differ by rounding, as
  // those of images, are equal.

  void find_partners()
  {
    const double tiny = 1e-8 * limit;
    start.assign(1, 0);
    size_t found = 0;
    for (int m = 0; m < owned; m++)
      for (size_t s = 0; s < species.size(); s++) {
        const double *c = row(m);
        const tagint excluded = neighbor->nex_mol ? atom->molecule[*atoms_of(m)] : 0;    // LAMMPS then excludes the images of a molecule, too
        const int x_from = bin(c[0] - limit, 0), x_to = bin(c[0] + limit, 0), y_to = bin(c[1] + limit, 1), z_to = bin(c[2] + limit, 2);
        for (int z = bin(c[2] - tiny, 2); z <= z_to; z++)
          for (int y = bin(c[1] - limit, 1); y <= y_to; y++) {
            const size_t begin = bin_start[row_of_bins(s, z, y) + x_from], end = bin_start[row_of_bins(s, z, y) + x_to + 1];
            if (partners.size() <= found + end - begin) partners.resize(2 * (found + end - begin) + 1);
            for (size_t k = begin; k < end; k++) {
              const Candidate &other = ordered[k];
              const double dx = other.x - c[0], dy = other.y - c[1], dz = other.z - c[2];
              const bool above = (dz > tiny) | ((dz >= -tiny) & ((dy > tiny) | ((dy >= -tiny) & (dx > 0.0))));
              partners[found] = other.molecule;
              found += (dx * dx + dy * dy + dz * dz < limit * limit) & above & (other.id != excluded);
            }
          }
        start.push_back(found);
      }
  }
};

}    // namespace nosquish
}    // namespace

#endif
