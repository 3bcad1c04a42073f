/* A cell, where compiled loops find an array each time they run (loops/compiled.py): its address and its shape. */

#ifndef FIX_NOSQUISH_CELL_H
#define FIX_NOSQUISH_CELL_H

#include <cstdint>

template <typename Number, int axes> struct Cell {
  const Number *array;
  int64_t rows, columns;    // no columns of an array with one axis

  void point(const Number *first, int64_t n, int64_t width = 0) { *this = {first, first ? n : 0, width}; }
  void point(Number *const *first, int64_t n, int64_t width) { point(first && n ? first[0] : nullptr, n, width); }
};

// a loop's kinds of arrays: of float64, int32 and int64
using F1 = Cell<double, 1>;
using F2 = Cell<double, 2>;
using I1 = Cell<int32_t, 1>;
using L1 = Cell<int64_t, 1>;

#endif
