/* The state of the integrator in LAMMPS's restart files. */

#ifndef FIX_NOSQUISH_RESTART_H
#define FIX_NOSQUISH_RESTART_H

#include "part.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace {
namespace nosquish {

// The state begins with five numbers: two zeros, OURS or WITH_BODIES, `rotor`, and the number of values of the integrator, which
// follow. With WITH_BODIES, then come the number of atoms whose body does not follow from the fix line, and three numbers for each. The
// per-atom state of LAMMPS's restart files cannot have these, because the command replicate refuses it, and a fix of another style does
// not get it. LAMMPS's own rigid fixes may get our state, because restart files contain no suffix; they ignore it because of the zeros.

class Restart : public Part {
 public:
  using Part::Part;

  // Write the size in bytes, then the state, on rank 0.

  void write(FILE *file) const
  {
    if (comm->me) return;
    const double mark = bridge.kept_rows ? WITH_BODIES : OURS, rows = bridge.kept_rows;
    const double begin[BEFORE] = {0.0, 0.0, mark, (double) bridge.rotor, (double) bridge.restart_size};
    const int numbers = bridge.restart_size + (rows ? 1 + 3 * bridge.kept_rows : 0), bytes = sizeof begin + numbers * sizeof(double);
    fwrite(&bytes, sizeof(int), 1, file);
    fwrite(begin, sizeof begin, 1, file);
    fwrite(bridge.restart_state, sizeof(double), bridge.restart_size, file);
    if (rows) fwrite(&rows, sizeof rows, 1, file);
    fwrite(bridge.kept_bodies, 3 * sizeof(double), bridge.kept_rows, file);
  }

  // Find the bodies of the restart file, for the constructor of the class.

  void find_bodies() const
  {
    char *state = RestartState::find(modify, fix->id, [](const std::string &style, const char *state) {
      return is_our_style(style) && is_our_state(state) && number(state, MARK) == WITH_BODIES;
    });
    if (!state) return;
    const int rows = BEFORE + (int) number(state, SIZE);
    bridge.kept_rows = (int32_t) number(state, rows);
    bridge.kept_bodies = reinterpret_cast<double *>(state) + rows + 1;
  }

  // Read a state. The first value of the integrator identifies its kind.

  void read(const char *state) const
  {
    const int size = bridge.restart_size;
    if (is_our_state(state)) {
      bridge.rotor = (int32_t) number(state, ROTOR);
      if (!size || !number(state, SIZE)) return;
      if (number(state, SIZE) == size && number(state, BEFORE) == bridge.restart_state[0])
        memcpy(bridge.restart_state, state + BEFORE * sizeof(double), size * sizeof(double));
      else bridge.restart_state[0] = -1.0;
    } else if (size) {
      warn("the restart file has a state for this ID that this fix did not write, as LAMMPS's own rigid fixes do: it is not used, "
           "and thermostat and barostat begin anew");
    }
  }

  // LAMMPS passes a fix the state of its ID and style. Take over that of another style of ours.

  void adopt() const
  {
    char *state = RestartState::find(modify, fix->id, [this](const std::string &other, const char *state) {
      if (!is_our_style(other) || other == fix->style || !is_our_state(state)) return false;
      return number(state, ROTOR) >= 0 || (has_state() && number(state, SIZE) > 0);
    });
    if (!state) return;
    read(state);
    if (comm->me == 0) utils::logmesg(lmp, problem(fix, "it goes on from the state of its ID in the restart file\n"));
  }

 private:
  enum { MARK = 2, ROTOR = 3, SIZE = 4, BEFORE = 5 };
  static constexpr double OURS = 4.929e-49, WITH_BODIES = 4.93e-49;

  bool has_state() const { return bridge.restart_size > 0 || bridge.rotor >= 0; }

  static bool is_our_style(const std::string &style)
  {
    return style == PYTHON_MOVE || replaces(style) || std::count(std::begin(NATIVE), std::end(NATIVE), style);
  }

  static double number(const char *state, int k)
  {
    double value;
    memcpy(&value, state + k * sizeof value, sizeof value);
    return value;
  }

  // The state of another fix may have only two numbers.

  static bool is_our_state(const char *state)
  {
    return number(state, 0) == 0.0 && number(state, 1) == 0.0 && (number(state, MARK) == OURS || number(state, MARK) == WITH_BODIES);
  }
};

}    // namespace nosquish
}    // namespace

#endif
