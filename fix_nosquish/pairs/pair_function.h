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

template <typename Real> struct PairFunction {
  Real charge, coul2, g_ewald;
  Real r12, r6, shift, lj2, inner2, steepness;

  operator PairFunction<float>() const
  {
    return {(float) charge, (float) coul2, (float) g_ewald, (float) r12, (float) r6, (float) shift, (float) lj2, (float) inner2, (float) steepness};
  }
};

template <typename Real> struct LaneForces {
  Lanes<Real> over_r, lj, coul;    // the force divided by the distance, and the energies
};

// LAMMPS's approximation of erfc, with an error of 1.5e-7 (Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26).

template <typename Real> INLINED Lanes<Real> erfc_over_exp(Lanes<Real> x)
{
  const Real p = 0.3275911, a[] = {0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429};
  const Lanes<Real> t = 1 / (1 + p * x);
  return t * (a[0] + t * (a[1] + t * (a[2] + t * (a[3] + t * a[4]))));
}

template <typename Real> INLINED LaneForces<Real> evaluate(const PairFunction<Real> &function, Lanes<Real> r2)
{
  const Lanes<Real> zero = r2 * 0, inverse = inverse_sqrt<Real>(r2), inverse2 = inverse * inverse;
  LaneForces<Real> pair = {zero, zero, zero};
  if (function.charge != 0) {
    Lanes<Real> energy = function.charge * inverse, force = energy;
    if (function.g_ewald > 0) {
      const Real two_over_sqrt_pi = 1.12837917;    // as LAMMPS rounds it
      const Lanes<Real> x = function.g_ewald * r2 * inverse, gauss = exponential<Real>(-x * x), screened = erfc_over_exp<Real>(x) * gauss;
      force = energy * (screened + two_over_sqrt_pi * x * gauss);
      energy *= screened;
    }
    pair.coul = r2 < function.coul2 ? energy : zero;
    pair.over_r = r2 < function.coul2 ? force * inverse2 : zero;
  }
  if (function.r12 > 0) {
    const Lanes<Real> inverse6 = inverse2 * inverse2 * inverse2;
    Lanes<Real> energy = inverse6 * (function.r12 * inverse6 - function.r6) - function.shift;
    Lanes<Real> force = inverse6 * (12 * function.r12 * inverse6 - 6 * function.r6);
    if (function.steepness != 0) {
      const Lanes<Real> rest = function.lj2 - r2, beyond = r2 - function.inner2, scaled = rest * function.steepness;
      const Lanes<Real> off = scaled * rest * (rest + 3 * beyond), slope = 12 * scaled * r2 * beyond;
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

  PairFunction<double> function(double unit_charge, double g_ewald, double inner2)
  {
    // two forces far from each other give both coefficients
    const double near = 1e-4 * cut2, far = 0.1 * cut2, near6 = near * near * near, far6 = far * far * far;
    const double a = force(near, 0.0) * near * near6 * near6, b = force(far, 0.0) * far * far6 * far6;    // 12 r12 - 6 r6 r^6
    const double six = (a - b) / (far6 - near6), twelve = a + six * near6;
    PairFunction<double> found = {coul2() > 0.0 ? unit_charge : 0.0, std::min(coul2(), cut2), g_ewald, twelve / 12.0, six / 6.0, 0.0, 0.0, inner2, 0.0};
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

  // The mean relative difference between this function and the style, for atoms of unit charge and of none.

  template <typename Real> double difference(PairFunction<Real> function)
  {
    double total = 0.0;
    for (const double charge : {1.0, 0.0}) {
      function.charge *= charge;
      for (int k = 1; k < 16; k++) {
        const double r2 = cut2 * k / 16.0, force = this->force(r2, charge);
        const LaneForces<Real> ours = evaluate<Real>(function, Lanes<Real>{} + (Real) r2);
        const double scale = std::fabs(force * r2) + std::fabs(energy) + 1e-100;
        total += (std::fabs(ours.over_r[0] - force) * r2 + std::fabs(ours.lj[0] + ours.coul[0] - energy)) / scale / 30.0;
      }
    }
    return total;
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
