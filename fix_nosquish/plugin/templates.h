/* What a molecule template of LAMMPS says of the whole molecule: its mass, centre of mass and inertia.

   LAMMPS installs no header of the class. Four of its methods are declared here, which work out what the template's file does not
   say. Where the class has the numbers differs between versions; how they follow one another does not, and their principal axes
   tell where they are: they stand twice there, as vectors and as a quaternion. */

#ifndef FIX_NOSQUISH_TEMPLATES_H
#define FIX_NOSQUISH_TEMPLATES_H

#include "styles.h"

#include "atom.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>
#include <vector>

namespace LAMMPS_NS {

class Molecule {
 public:
  void compute_center();
  void compute_mass();
  void compute_com();
  void compute_inertia();
};

}    // namespace LAMMPS_NS

namespace MathExtra {
void q_to_exyz(double *quat, double *x, double *y, double *z);
}

namespace {
namespace nosquish {

class Templates {
 public:
  // as LAMMPS's class has them, one behind the other, from 29 Aug 2024 to 4 Jul 2026; of another order nothing is found
  enum { CENTER = 0, MASS = 3, COM = 4, TENSOR = 7, KNOWN = 13, AXES = 16, QUAT = 25, ALL = 29 };

  // Write the geometric centre, mass, centre of mass and tensor of inertia (xx yy zz yz xz xy) of a template, KNOWN numbers;
  // no number for what it does not say and LAMMPS cannot work out. Returns whether they were found.

  static bool read(Atom *atom, Molecule *molecule, double *numbers)
  {
    // where types have no masses LAMMPS would read them nevertheless, for atoms to which the template gives none
    std::vector<double> masses(atom->ntypes + 1, FAINT);
    const bool lacking = !atom->mass;
    if (lacking) atom->mass = masses.data();
    molecule->compute_center();
    molecule->compute_mass();
    molecule->compute_com();
    molecule->compute_inertia();
    if (lacking) atom->mass = nullptr;

    double found[ALL];
    const char *object = reinterpret_cast<const char *>(molecule);
    for (int at = 0; at + (int) sizeof(found) <= BYTES; at += sizeof(double)) {
      memcpy(found, object + at, sizeof(found));
      if (!same_axes(found + AXES, found + QUAT)) continue;
      std::copy_n(found, (int) KNOWN, numbers);
      if (lacking) drop_faint(numbers);
      return true;
    }
    return false;
  }

 private:
  static constexpr double FAINT = 1e-150;    // a mass that no template has
  static constexpr int BYTES = 2048;         // they begin before half of this

  // Whether three axes are those of a quaternion, if it is one.

  static bool same_axes(const double *axes, double *quat)
  {
    double turned[9];
    MathExtra::q_to_exyz(quat, turned, turned + 3, turned + 6);
    auto same = [](double a, double b) { return std::fabs(a - b) < 1e-6; };    // false of no number
    return same(std::inner_product(quat, quat + 4, quat, 0.0), 1.0) && std::equal(turned, turned + 9, axes, same);
  }

  // No number for what was worked out with masses that are none. With such a mass the centre is that of equal weights.

  static void drop_faint(double *numbers)
  {
    const double none = std::nan("");
    for (const auto &[from, to] : {std::pair{COM, TENSOR}, {TENSOR, KNOWN}, {MASS, COM}}) {
      double most = 0.0;
      for (int k = from; k < to; k++) most = std::max(most, std::fabs(numbers[k]));
      if (most > 0.0 && most < 1e50 * FAINT) std::fill(numbers + from, numbers + to, none);
    }
    if (std::isnan(numbers[MASS])) std::fill(numbers + COM, numbers + TENSOR, none);
  }
};

}    // namespace nosquish
}    // namespace

#endif
