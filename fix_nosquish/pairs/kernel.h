/* Forces between molecules: of one molecule and several others at a time, site by site. */

#ifndef FIX_NOSQUISH_KERNEL_H
#define FIX_NOSQUISH_KERNEL_H

#include "molecule_list.h"
#include "pair_function.h"

namespace {
namespace nosquish {

struct Energies {
  double lj = 0.0, coul = 0.0;
};

// Add the forces between molecule m and its partners of species t to the list's, and their energies. Distances from the centre of m, and
// their functions, have the precision of Real. functions: of species s and t and their sites a and b, at
// ((s * species + t) * MOST_SITES + a) * MOST_SITES + b.
// SITES: of both molecules, if the compiler is to know it, and otherwise 0.

template <typename Real, int SITES>
INLINED void molecule_forces(MoleculeList &list, const PairFunction<Real> *functions, Energies &energies, int m, int t)
{
  const int s = list.kind[m], stride = list.stride, n = SITES ? SITES : list.species[s].sites, n_other = SITES ? SITES : list.species[t].sites;
  const size_t kinds = list.species.size(), begin = list.start[m * kinds + t], end = list.start[m * kinds + t + 1];
  double *rows = list.rows.data(), *centre = &rows[(size_t) m * stride];
  functions += (s * kinds + t) * MOST_SITES * MOST_SITES;

  // those near enough now
  const double limit = list.cutoff + 2.0 * list.reach;
  int *near = list.near.data(), count = 0;
  for (size_t k = begin; k < end; k++) {
    const double *c = &rows[(size_t) list.partners[k] * stride], dx = c[0] - centre[0], dy = c[1] - centre[1], dz = c[2] - centre[2];
    near[count] = list.partners[k];
    count += dx * dx + dy * dy + dz * dz < limit * limit;
  }
  // the rest of the last lanes are no molecule, whose sites are all out of reach
  std::fill_n(near + count, LANES<Real>, list.all);
  std::fill_n(&rows[(size_t) list.all * stride], stride, centre[0] + limit);

  Real x[3 * MOST_SITES];
  for (int d = 0; d < 3 * n; d++) x[d] = centre[3 + d] - centre[d % 3];
  Lanes<Real> force[3 * MOST_SITES], lj = {}, coul = {};
  std::fill_n(force, 3 * n, Lanes<Real>{});
  for (int k = 0; k < count; k += LANES<Real>) {
    Lanes<Real> other[3 * MOST_SITES], other_force[3 * MOST_SITES];
    std::fill_n(other_force, 3 * n_other, Lanes<Real>{});
    for (int lane = 0; lane < LANES<Real>; lane++) {
      const double *row = &rows[(size_t) near[k + lane] * stride + 3];
#pragma GCC unroll 9
      for (int d = 0; d < 3 * n_other; d++) other[d][lane] = row[d] - centre[d % 3];
    }
    for (int a = 0; a < n; a++)
#pragma GCC unroll 3
      for (int b = 0; b < n_other; b++) {
        const Lanes<Real> dx = x[3 * a] - other[3 * b], dy = x[3 * a + 1] - other[3 * b + 1], dz = x[3 * a + 2] - other[3 * b + 2];
        const LaneForces<Real> value = evaluate<Real>(functions[a * MOST_SITES + b], dx * dx + dy * dy + dz * dz);
        const Lanes<Real> fx = value.over_r * dx, fy = value.over_r * dy, fz = value.over_r * dz;
        force[3 * a] += fx, force[3 * a + 1] += fy, force[3 * a + 2] += fz;
        other_force[3 * b] -= fx, other_force[3 * b + 1] -= fy, other_force[3 * b + 2] -= fz;
        lj += value.lj, coul += value.coul;
      }
    for (int lane = 0; lane < LANES<Real>; lane++) {
      double *row = &list.forces[(size_t) near[k + lane] * stride + 3];
#pragma GCC unroll 9
      for (int d = 0; d < 3 * n_other; d++) row[d] += other_force[d][lane];
    }
  }
  for (int d = 0; d < 3 * n; d++) list.forces[(size_t) m * stride + 3 + d] += sum<Real>(force[d]);
  energies.lj += sum<Real>(lj), energies.coul += sum<Real>(coul);
}

template <typename Real> INLINED Energies all_forces(MoleculeList &list, const PairFunction<Real> *functions)
{
  Energies energies;
  for (int m = 0; m < list.owned; m++)
    for (int t = 0; t < (int) list.species.size(); t++)
      list.species[list.kind[m]].sites == 3 && list.species[t].sites == 3 ? molecule_forces<Real, 3>(list, functions, energies, m, t)
                                                                            : molecule_forces<Real, 0>(list, functions, energies, m, t);
  return energies;
}

#ifdef __x86_64__
template <typename Real> __attribute__((target("avx2,fma"))) Energies forces_for_avx2(MoleculeList &list, const PairFunction<Real> *functions)
{
  return all_forces<Real>(list, functions);
}

template <typename Real>
__attribute__((target("avx512f,avx512dq,avx512vl,avx2,fma"))) Energies forces_for_avx512(MoleculeList &list, const PairFunction<Real> *functions)
{
  return all_forces<Real>(list, functions);
}
#endif

// Compute the forces by the instructions that this processor has.

template <typename Real> Energies compute_forces(MoleculeList &list, const PairFunction<Real> *functions)
{
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return forces_for_avx512(list, functions);
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return forces_for_avx2(list, functions);
#endif
  return all_forces<Real>(list, functions);
}

}    // namespace nosquish
}    // namespace

#endif
