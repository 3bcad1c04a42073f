/* The energy and force between two atoms, as pair styles lj/cut, lj/cut/coul/cut, lj/cut/coul/long and lj/charmm/coul/long have them. */

#ifndef FIX_NOSQUISH_PAIR_FUNCTION_H
#define FIX_NOSQUISH_PAIR_FUNCTION_H

#include "lanes.h"

#include "pair.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace {
namespace nosquish {
using namespace LAMMPS_NS;

// The Coulomb energy is charge / r up to the squared distance coul2, times erfc(g_ewald r) if g_ewald is not 0. The Lennard-Jones energy is
// r12 / r^12 - r6 / r^6 - shift up to lj2; it is switched off from inner2 on, if steepness = (lj2 - inner2)^-3 is not 0.

struct PairFunction {
  double charge, coul2, g_ewald;
  double r12, r6, shift, lj2, inner2, steepness;
};

struct LaneForces {
  Lanes over_r, lj, coul;    // the force divided by the distance, and the energies
};

// LAMMPS's approximation of erfc, with an error of 1.5e-7 (Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26).

INLINED Lanes erfc_over_exp(Lanes x)
{
  const Lanes t = 1.0 / (1.0 + 0.3275911 * x);
  return t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
}

INLINED LaneForces evaluate(const PairFunction &function, Lanes r2)
{
  const Lanes zero = r2 * 0.0, inverse = inverse_sqrt(r2), inverse2 = inverse * inverse;
  LaneForces pair = {zero, zero, zero};
  if (function.charge != 0.0) {
    Lanes energy = function.charge * inverse, force = energy;
    if (function.g_ewald > 0.0) {
      const Lanes x = function.g_ewald * r2 * inverse, gauss = exponential(-x * x), screened = erfc_over_exp(x) * gauss;
      force = energy * (screened + 1.12837917 * x * gauss);    // 2 / sqrt(pi), as LAMMPS rounds it
      energy *= screened;
    }
    pair.coul = r2 < function.coul2 ? energy : zero;
    pair.over_r = r2 < function.coul2 ? force * inverse2 : zero;
  }
  if (function.r12 > 0.0) {
    const Lanes inverse6 = inverse2 * inverse2 * inverse2;
    Lanes energy = inverse6 * (function.r12 * inverse6 - function.r6) - function.shift;
    Lanes force = inverse6 * (12.0 * function.r12 * inverse6 - 6.0 * function.r6);
    if (function.steepness != 0.0) {
      const Lanes rest = function.lj2 - r2, beyond = r2 - function.inner2, scaled = rest * function.steepness;
      const Lanes off = scaled * rest * (rest + 3.0 * beyond), slope = 12.0 * scaled * r2 * beyond;
      force = r2 > function.inner2 ? force * off + energy * slope : force;
      energy = r2 > function.inner2 ? energy * off : energy;
    }
    pair.lj = r2 < function.lj2 ? energy : zero;
    pair.over_r += r2 < function.lj2 ? force * inverse2 : zero;
  }
  return pair;
}

// Finds the functions of a pair style from the energies and forces that the style itself computes for two atoms.

class StyleProbe {
 public:
  StyleProbe(Pair *pair, double *charges, int itype, int jtype)
      : pair(pair), charges(charges), itype(itype), jtype(jtype), cut2(pair->cutsq[itype][jtype])
  {
  }

  // Of atoms of unit charge; unit_charge is their Coulomb energy at distance 1, inner2 and g_ewald are 0 if there is none.

  PairFunction function(double unit_charge, double g_ewald, double inner2)
  {
    // two forces far from each other give both coefficients
    const double near = 1e-4 * cut2, far = 0.1 * cut2, near6 = near * near * near, far6 = far * far * far;
    const double a = force(near, 0.0) * near * near6 * near6, b = force(far, 0.0) * far * far6 * far6;    // 12 r12 - 6 r6 r^6
    const double six = (a - b) / (far6 - near6), twelve = a + six * near6;
    PairFunction found = {coul2() > 0.0 ? unit_charge : 0.0, std::min(coul2(), cut2), g_ewald, twelve / 12.0, six / 6.0, 0.0, 0.0, inner2, 0.0};
    found.shift = (found.r12 / far6 - found.r6) / far6 - energy;    // of `far`
    if (std::fabs(found.shift) < 1e-10 * std::fabs(energy)) found.shift = 0.0;
    // the last distance with a force
    double inside = far, outside = cut2;
    for (int k = 0; k < 80; k++) {
      const double middle = 0.5 * (inside + outside);
      (force(middle, 0.0) != 0.0 ? inside : outside) = middle;
    }
    found.lj2 = outside;
    if (inner2 > 0.0 && inner2 < found.lj2) found.steepness = std::pow(found.lj2 - inner2, -3);
    return found;
  }

  // The largest relative difference between this function and the style, for atoms of unit charge.

  double difference(const PairFunction &function)
  {
    double largest = 0.0;
    for (int k = 1; k < 16; k++) {
      const double r2 = cut2 * k / 16.0, r6 = r2 * r2 * r2;
      const double scale = function.charge / std::sqrt(r2) + (std::fabs(function.r6) + std::fabs(function.r12) / r6) / r6 + 1e-100;
      const LaneForces ours = evaluate(function, Lanes{} + r2);
      const double force = this->force(r2, 1.0);
      largest = std::max({largest, std::fabs(ours.over_r[0] - force) * r2 / scale, std::fabs(ours.lj[0] + ours.coul[0] - energy) / scale});
    }
    return largest;
  }

 private:
  Pair *pair;
  double *charges;
  int itype, jtype;
  double cut2, energy = 0.0;

  // The force divided by the distance, and the energy, of the first atom and a copy of it.

  double force(double r2, double charge)
  {
    double force, own = charges ? std::exchange(charges[0], charge) : 0.0;
    energy = pair->single(0, 0, itype, jtype, r2, 1.0, 1.0, force);
    if (charges) charges[0] = own;
    return force;
  }

  double coul2() const
  {
    int dim;
    const void *cut = pair->extract("cut_coul", dim);
    return !cut ? 0.0 : std::pow(dim ? static_cast<const double *const *>(cut)[itype][jtype] : *static_cast<const double *>(cut), 2);
  }
};

}    // namespace nosquish
}    // namespace

#endif
