/* Mass, center of mass and inertia of a molecule template. */

#ifndef FIX_NOSQUISH_TEMPLATES_H
#define FIX_NOSQUISH_TEMPLATES_H

#include "lammps_versions.h"
#include "styles.h"

#include "atom.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace {
namespace nosquish {

class Templates {
 public:
  enum { CENTER = 0, MASS = 3, COM = 4, TENSOR = 7, ALL = 13 };

  // Write the geometric center, mass, center of mass and tensor of inertia (xx yy zz yz xz xy) of a template, ALL numbers; NaN for
  // what the template does not give and LAMMPS cannot compute. Returns whether they are known for this LAMMPS.

  static bool read(Atom *atom, Molecule *molecule, double *numbers)
  {
    const double *properties = properties_of(molecule);
    if (!properties) return false;
    // without masses of types LAMMPS would read them nevertheless, for atoms to which the template gives none
    std::vector<double> masses(atom->ntypes + 1, FAINT);
    const bool lacking = !atom->mass;
    if (lacking) atom->mass = masses.data();
    molecule->compute_center();
    molecule->compute_mass();
    molecule->compute_com();
    molecule->compute_inertia();
    if (lacking) atom->mass = nullptr;
    std::copy_n(properties, (int) ALL, numbers);
    if (lacking) drop_faint(numbers);
    return true;
  }

 private:
  static constexpr double FAINT = 1e-150;    // a mass that no template has

  // Set to NaN what was computed with FAINT masses. The center of mass is then that of equal weights.

  static void drop_faint(double *numbers)
  {
    const double none = std::nan("");
    for (const auto &[from, to] : {std::pair{COM, TENSOR}, {TENSOR, ALL}, {MASS, COM}}) {
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
