/* Arithmetic with the numbers of several pairs of molecules at once. The compiler makes it from what each processor has. */

#ifndef FIX_NOSQUISH_LANES_H
#define FIX_NOSQUISH_LANES_H

#include <cstdint>
#include <type_traits>

#pragma GCC diagnostic ignored "-Wignored-attributes"

namespace {
namespace nosquish {

// As many numbers of type Real as one register of AVX-512 holds: 8 double, or 16 float.

template <typename Real> constexpr int LANES = 64 / sizeof(Real);
template <typename Real> using Lanes __attribute__((vector_size(64))) = Real;
template <typename Real> using Bits = std::conditional_t<sizeof(Real) == 8, int64_t, int32_t>;

// Functions with lanes as arguments are always inlined: then the interface for functions, which differs between processors, is not used.

#define INLINED inline __attribute__((always_inline))

template <typename Real> INLINED double sum(Lanes<Real> x)
{
  double total = 0.0;
  for (int k = 0; k < LANES<Real>; k++) total += x[k];
  return total;
}

// 1 / sqrt(x): a guess from the bits of x, and Newton's steps, each of which doubles the number of correct digits.

template <typename Real> INLINED Lanes<Real> inverse_sqrt(Lanes<Real> x)
{
  const Bits<Real> guess = sizeof(Real) == 8 ? 0x5fe6eb50c7b537a9 : 0x5f375a86;
  Lanes<Real> y = (Lanes<Real>) (guess - ((Lanes<Bits<Real>>) x >> 1));
#pragma GCC unroll 4
  for (int k = 0; k < (sizeof(Real) == 8 ? 4 : 3); k++) y = y * ((Real) 1.5 - (Real) 0.5 * x * y * y);
  return y;
}

// exp(x) for x <= 0: x = n log(2) + r, and a series for exp(r) with an error of 6e-15, or 1e-8. To add a large number rounds to the
// integer n, and n added to the exponent multiplies by 2^n. Below -700, or -80, where 2^n has no such exponent, the result is meaningless.

template <typename Real> INLINED Lanes<Real> exponential(Lanes<Real> x)
{
  constexpr bool LONG = sizeof(Real) == 8;
  const Real round = LONG ? 0x1.8p52 : 0x1.8p23, inverse_log2 = 0x1.71547652b82fep0,
             log2_high = LONG ? 0x1.62e42feep-1 : 0x1.62e4p-1, log2_low = LONG ? 0x1.a39ef35793c76p-33 : 0x1.7f7d1cp-20;
  const Lanes<Real> shifted = x * inverse_log2 + round, n = shifted - round, r = x - n * log2_high - n * log2_low;
  // in the order of Estrin, with few steps that wait for each other
  const Real c[] = {1.0, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800};
  const Lanes<Real> r2 = r * r, r4 = r2 * r2, middle = (c[4] + r * c[5]) + r2 * (c[6] + r * c[7]);
  const Lanes<Real> high = LONG ? middle + r4 * ((c[8] + r * c[9]) + r2 * (c[10] + r * c[11])) : middle;
  return (Lanes<Real>) ((Lanes<Bits<Real>>) (((c[0] + r * c[1]) + r2 * (c[2] + r * c[3])) + r4 * high) + ((Lanes<Bits<Real>>) shifted << (LONG ? 52 : 23)));
}

}    // namespace nosquish
}    // namespace

#endif
