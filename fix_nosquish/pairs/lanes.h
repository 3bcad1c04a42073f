/* Arithmetic with the numbers of eight pairs of molecules at once. The compiler makes it from what each processor has. */

#ifndef FIX_NOSQUISH_LANES_H
#define FIX_NOSQUISH_LANES_H

#include <cstdint>

#pragma GCC diagnostic ignored "-Wignored-attributes"

namespace {
namespace nosquish {

constexpr int LANES = 8;
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t LaneBits __attribute__((vector_size(LANES * sizeof(int64_t))));

// Functions with lanes as arguments are always inlined: then the interface for functions, which differs between processors, is not used.

#define INLINED inline __attribute__((always_inline))

INLINED double sum(Lanes x)
{
  double total = 0.0;
  for (int k = 0; k < LANES; k++) total += x[k];
  return total;
}

// 1 / sqrt(x): a guess from the bits of x, and four of Newton's steps, each of which doubles the number of correct digits.

INLINED Lanes inverse_sqrt(Lanes x)
{
  Lanes y = (Lanes) (0x5fe6eb50c7b537a9 - ((LaneBits) x >> 1));
#pragma GCC unroll 4
  for (int k = 0; k < 4; k++) y = y * (1.5 - 0.5 * x * y * y);
  return y;
}

// exp(x) for x <= 0: x = n log(2) + r, and a series for exp(r) with an error of 6e-15. To add a large number rounds to the integer n,
// and n added to the exponent multiplies by 2^n. Below -700, where 2^n has no such exponent, the result is meaningless.

INLINED Lanes exponential(Lanes x)
{
  const double round = 0x1.8p52, inverse_log2 = 0x1.71547652b82fep0, log2_high = 0x1.62e42feep-1, log2_low = 0x1.a39ef35793c76p-33;
  const Lanes shifted = x * inverse_log2 + round, n = shifted - round, r = x - n * log2_high - n * log2_low;
  // in the order of Estrin, with few steps that wait for each other
  const Lanes r2 = r * r, r4 = r2 * r2;
  const Lanes low = (1.0 + r) + r2 * (1.0 / 2 + r * (1.0 / 6)), middle = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040));
  const Lanes high = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800 + r * (1.0 / 39916800));
  const Lanes series = low + r4 * (middle + r4 * high);
  return (Lanes) ((LaneBits) series + ((LaneBits) shifted << 52));
}

}    // namespace nosquish
}    // namespace

#endif
