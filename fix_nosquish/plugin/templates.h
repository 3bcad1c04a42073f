/* Mass, center of mass and inertia of a molecule template. */

#ifndef FIX_NOSQUISH_TEMPLATES_H
#define FIX_NOSQUISH_TEMPLATES_H

#include "lammps_versions.h"
#include "styles.h"

#include "atom.h"

#include <algorithm>
#include <cmath>
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
    const bool massless = !atom->mass;
    if (massless) atom->mass = masses.data();
    molecule->compute_center();
    molecule->compute_mass();
    molecule->compute_com();
    molecule->compute_inertia();
    if (massless) atom->mass = nullptr;
    std::copy_n(properties, (int) ALL, numbers);
    if (massless) drop_faint(numbers);
    return true;
  }

 private:
  static constexpr double FAINT = 1e-150, LIMIT = 1e50 * FAINT;    // a mass that no template has, and what is computed with it

  // Set to NaN what was computed with FAINT masses. The center of mass is then that of equal weights.

  static void drop_faint(double *numbers)
  {
    const double *moments = numbers + TENSOR, unknown = std::nan("");
    if (numbers[MASS] < LIMIT) std::fill(numbers + MASS, numbers + TENSOR, unknown);
    if (std::fabs(moments[0]) + std::fabs(moments[1]) + std::fabs(moments[2]) < LIMIT)
      std::fill(numbers + TENSOR, numbers + ALL, unknown);
  }
};

}    // namespace nosquish
}    // namespace

#endif
