/* Particles with an orientation: ellipsoids, lines and triangles.

   LAMMPS does not install the headers of these atom styles. Two methods of each are declared here, by which LAMMPS sends a particle
   to ghost atoms: one writes its shape and orientation to a buffer, the other reads its orientation. The number of values that is
   written identifies their format; unknown formats are refused. */

#ifndef FIX_NOSQUISH_PARTICLES_H
#define FIX_NOSQUISH_PARTICLES_H

#include "atom.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <typeinfo>

namespace LAMMPS_NS {

class AtomVecEllipsoid {
 public:
  int pack_border_bonus(int n, int *atoms, double *buffer);
  void unpack_comm_bonus(int n, int first, double *buffer);
};

class AtomVecLine {
 public:
  int pack_border_bonus(int n, int *atoms, double *buffer);
  void unpack_comm_bonus(int n, int first, double *buffer);
};

class AtomVecTri {
 public:
  int pack_border_bonus(int n, int *atoms, double *buffer);
  void unpack_comm_bonus(int n, int first, double *buffer);
};

}    // namespace LAMMPS_NS

namespace {
namespace nosquish {

using namespace LAMMPS_NS;

class Particles {
 public:
  explicit Particles(Atom *atom) : atom(atom) {}

  // Write for each local atom three numbers and a quaternion: the principal moments of an ellipsoid or a triangle, or the length of a
  // line; zeros for other atoms. Returns false if a style or a format is unknown.

  bool read(double *numbers)
  {
    ellipsoids = style<AtomVecEllipsoid>("ellipsoid", "N9LAMMPS_NS16AtomVecEllipsoidE");
    lines = style<AtomVecLine>("line", "N9LAMMPS_NS11AtomVecLineE");
    tris = style<AtomVecTri>("tri", "N9LAMMPS_NS10AtomVecTriE");
    double packed[64];    // longer than all formats; the first number is a flag
    for (int i = 0; i < atom->nlocal; i++, numbers += 7) {
      std::fill_n(numbers, 7, 0.0);
      if (is(atom->ellipsoid, i)) {
        if (!ellipsoids) return false;
        const int count = ellipsoids->pack_border_bonus(1, &i, packed);
        std::copy_n(packed + 4, 4, numbers + 3);
        if (count == PLAIN) {
          const double a = packed[1] * packed[1], b = packed[2] * packed[2], c = packed[3] * packed[3];
          numbers[0] = atom->rmass[i] * (0.2 * b + 0.2 * c);
          numbers[1] = atom->rmass[i] * (0.2 * a + 0.2 * c);
          numbers[2] = atom->rmass[i] * (0.2 * a + 0.2 * b);
        } else if (count == SUPER) {    // two exponents of the shape, then its moments
          std::copy_n(packed + 10, 3, numbers);
        } else {
          return false;
        }
      } else if (is(atom->line, i)) {
        if (!lines || lines->pack_border_bonus(1, &i, packed) != LINE) return false;
        numbers[0] = packed[1];
        numbers[3] = std::cos(0.5 * packed[2]);
        numbers[6] = std::sin(0.5 * packed[2]);
      } else if (is(atom->tri, i)) {
        if (!tris || tris->pack_border_bonus(1, &i, packed) != TRI) return false;
        std::copy_n(packed + 14, 3, numbers);
        std::copy_n(packed + 1, 4, numbers + 3);
      }
    }
    return true;
  }

  // Set the orientation of a local atom, if it has one.

  int64_t orient(int64_t atom_of_rank, const double *quat) const
  {
    const int i = (int) atom_of_rank;
    double numbers[4] = {quat[0], quat[1], quat[2], quat[3]};
    if (is(atom->ellipsoid, i)) {
      ellipsoids->unpack_comm_bonus(1, i, numbers);
    } else if (is(atom->line, i)) {
      const double half = std::atan2(quat[3], quat[0]), pi = std::acos(-1.0);
      numbers[0] = 2.0 * (half > 0.5 * pi ? half - pi : half <= -0.5 * pi ? half + pi : half);
      lines->unpack_comm_bonus(1, i, numbers);
    } else if (is(atom->tri, i)) {
      tris->unpack_comm_bonus(1, i, numbers);
    } else if (atom->quat_flag) {
      std::copy_n(quat, 4, atom->quat[i]);
    }
    return 0;
  }

 private:
  // the numbers of values of an ellipsoid, a superellipsoid, a line and a triangle, from 29 Aug 2024 to 4 Jul 2026
  enum { PLAIN = 8, SUPER = 13, LINE = 3, TRI = 17 };

  Atom *const atom;
  AtomVecEllipsoid *ellipsoids = nullptr;
  AtomVecLine *lines = nullptr;
  AtomVecTri *tris = nullptr;

  static bool is(const int *index, int i) { return index && index[i] >= 0; }

  // The atom style of this name, if it is of exactly this class; derived classes of other packages have another layout.

  struct Object {
    virtual ~Object();
  };

  template <typename Style> Style *style(const char *name, const char *mangled) const
  {
    auto object = reinterpret_cast<Object *>(atom->style_match(name));
    if (!object || strcmp(typeid(*object).name(), mangled) != 0) return nullptr;
    return static_cast<Style *>(dynamic_cast<void *>(object));
  }
};

}    // namespace nosquish
}    // namespace

#endif
