/* Clusters of fix shake or rattle in a box that changes. */

#ifndef FIX_NOSQUISH_CLUSTERS_H
#define FIX_NOSQUISH_CLUSTERS_H

#include "part.h"

#include "atom.h"
#include "domain.h"
#include "modify.h"

#include <algorithm>
#include <vector>

namespace {
namespace nosquish {

// Whether a fix constrains clusters of atoms.

bool constrains(const Fix *fix)
{
  return utils::strmatch(fix->style, "^shake") || utils::strmatch(fix->style, "^rattle");
}

// A cluster moves with the box as a whole, by its center of mass, so its constraints stay satisfied, and their forces do no work.
// An atom that is not constrained is its own cluster.

class Clusters : public Part {
 public:
  using Part::Part;

  // Fill the cell `clusters`: for each local atom its position relative to the center of mass of its cluster, and the velocity of that
  // center. Ghost atoms are updated first. Returns the ID of an atom whose cluster does not move with the box as a whole, or 0.
  // Collective.

  int64_t find()
  {
    comm->forward_comm();
    comm->forward_comm(fix);
    std::vector<Fix *> constraining;
    for (const auto &other : modify->get_fix_list())
      if (constrains(other)) constraining.push_back(other);
    rows.assign(6 * (size_t) atom->nlocal, 0.0);
    tagint cut = 0;
    for (int i = 0; i < atom->nlocal; i++) {
      double *cluster = &rows[6 * (size_t) i];
      std::copy_n(atom->v[i], 3, cluster + 3);
      for (Fix *other : constraining)
        if ((atom->mask[i] & bridge.held) && !fill(i, other, cluster)) cut = std::max(cut, atom->tag[i]);
    }
    bridge.arrays->clusters.point(rows.data(), atom->nlocal, 6);
    return cut;
  }

  // Velocities for ghost atoms.

  int pack(int n, const int *list, double *buffer) const
  {
    for (int k = 0; k < n; k++) buffer = std::copy_n(atom->v[list[k]], 3, buffer);
    return 3 * n;
  }

  void unpack(int n, int first, const double *buffer) const
  {
    for (int i = first; i < first + n; i++, buffer += 3) std::copy_n(buffer, 3, atom->v[i]);
  }

 private:
  std::vector<double> rows;

  // Fill the row of an atom. What fix shake sends with an atom to another rank begins with the number of atoms of its cluster (1: three
  // with an angle) and their IDs. Returns whether all of these move with the box.

  bool fill(int i, Fix *other, double *cluster) const
  {
    double sent[16], mass = 0.0;
    bool all_move = true;
    other->pack_exchange(i, sent);
    const int flag = (int) sent[0], members = flag == 1 ? 3 : flag;
    if (!members) return true;
    std::fill_n(cluster, 6, 0.0);
    for (int k = 1; k <= members; k++) {
      const int j = domain->closest_image(i, atom->map((tagint) sent[k]));
      if (j < 0) continue;    // fix shake will end the run with a message
      all_move &= (atom->mask[j] & bridge.held) != 0;
      const double m = atom->rmass ? atom->rmass[j] : atom->mass[atom->type[j]];
      mass += m;
      for (int c = 0; c < 3; c++) {
        cluster[c] += m * (atom->x[i][c] - atom->x[j][c]);
        cluster[3 + c] += m * atom->v[j][c];
      }
    }
    for (int c = 0; c < 6; c++) cluster[c] /= mass;
    return all_move;
  }
};

}    // namespace nosquish
}    // namespace

#endif
