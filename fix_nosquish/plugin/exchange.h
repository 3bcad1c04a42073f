/* Data that travel with atoms to other ranks: their origin, and their body. */

#ifndef FIX_NOSQUISH_EXCHANGE_H
#define FIX_NOSQUISH_EXCHANGE_H

#include "part.h"

#include "atom.h"
#include "group.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"

#include <algorithm>
#include <vector>

namespace {
namespace nosquish {

// `origin` and `membership` are per-atom arrays: they follow atoms that LAMMPS sorts, sends to other ranks, adds or deletes. With an
// atom that goes to another rank its body is sent, and becomes a row of `arrived` there. It is sent on if the atom is. The cell
// `arrived` has the number of rows in use.

class Exchange : public Part {
 public:
  int64_t *origin = nullptr;        // rank << 32 | index when the class noted its atoms; IN_NO_BODY; or -2 - row of `arrived`
  int64_t *membership = nullptr;    // the ID of the atom's body, or what Python has instead; UNDECIDED for a new atom
  std::vector<double> arrived;

  using Part::Part;

  ~Exchange() override
  {
    if (modify->get_fix_by_id(fix->id)) atom->delete_callback(fix->id, Atom::GROW);
    release();
  }

  // Arrays for the constructor of the class.

  void make_arrays()
  {
    grow(atom->nmax);
    for (int i = 0; i < atom->nlocal; i++) reset(i);
  }

  // Have LAMMPS call the fix for atoms.

  void begin()
  {
    fix->create_attribute = 1;
    fix->maxexchange = 1 + std::max(1, bridge.carries);
    atom->add_callback(Atom::GROW);
  }

  void grow(int n)
  {
    memory->grow(origin, n, "python/move:origin");
    memory->grow(membership, n, "python/move:membership");
  }

  void copy(int i, int j)
  {
    origin[j] = origin[i];
    membership[j] = membership[i];
  }

  void reset(int i)
  {
    origin[i] = IN_NO_BODY;
    membership[i] = UNDECIDED;
  }

  bool moves(int i) const { return origin && origin[i] != IN_NO_BODY; }    // the class has noted this atom

  int pack(int i, double *buffer) const
  {
    const int64_t from = origin[i];
    const bool known = from < IN_NO_BODY || (from >= 0 && bridge.state);
    *buffer++ = ubuf(membership[i]).d;
    if (!bridge.carries || !known) {
      buffer[0] = ubuf(bridge.carries ? IN_NO_BODY : from).d;
      return 2;
    }
    buffer[0] = ubuf(from).d;
    if (from < IN_NO_BODY) {
      std::copy_n(&arrived[(-2 - from) * bridge.carries], bridge.carries, buffer);
    } else {
      const int64_t place = from & 0xffffffff;
      buffer = column(bridge.state, reinterpret_cast<const int64_t *>(bridge.body_of[0])[place], buffer);
      column(bridge.displace, place, buffer);
    }
    return 1 + bridge.carries;
  }

  int unpack(int i, const double *buffer)
  {
    membership[i] = ubuf(*buffer++).i;
    const int64_t from = origin[i] = ubuf(buffer[0]).i;
    if (!bridge.carries || from == IN_NO_BODY) return 2;
    if (from >> 32 != comm->me && bridge.arrays) {    // else its body is here
      int64_t &rows = bridge.arrays->arrived.rows;
      origin[i] = -2 - rows;
      arrived.resize(rows++ * bridge.carries);
      arrived.insert(arrived.end(), buffer, buffer + bridge.carries);
    }
    return 1 + bridge.carries;
  }

  // LAMMPS does not reset the forces on atoms outside the group of neigh_modify include.

  void refuse_stale_forces() const
  {
    const int bit = neighbor->includegroup ? group->bitmask[neighbor->includegroup] : 0;
    tagint local = 0, left_out = 0;
    for (int i = 0; i < atom->nlocal && bit; i++)
      if (moves(i) && !(atom->mask[i] & bit)) local = atom->tag[i];
    if (bit) MPI_Allreduce(&local, &left_out, 1, MPI_LMP_TAGINT, MPI_MAX, world);
    if (left_out)
      refuse("neigh_modify include leaves out atom " + std::to_string(left_out) + ", which this fix moves, and LAMMPS computes no forces on "
             "such atoms: have all bodies and atoms of keyword flexible in that group (and in that of atom_modify first), or leave it out");
  }

  double bytes() const { return 2.0 * atom->nmax * sizeof(int64_t) + arrived.capacity() * sizeof(double); }

 private:
  void release()
  {
    memory->destroy(origin);
    memory->destroy(membership);
  }

  // Append column k of an array to the buffer, whose last number is given; return the new last one.

  static double *column(const int64_t *cell, int64_t k, double *last)
  {
    const auto values = reinterpret_cast<const double *>(cell[0]);
    for (int64_t row = 0; row < cell[1]; row++) *++last = values[row * cell[2] + k];
    return last;
  }
};

}    // namespace nosquish
}    // namespace

#endif
