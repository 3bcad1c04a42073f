/* The state of the integrator in LAMMPS's restart files. */

#ifndef FIX_NOSQUISH_RESTART_H
#define FIX_NOSQUISH_RESTART_H

#include "part.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace {
namespace nosquish {

// Before the integrator's numbers stand five of the fix: two zeros, `OURS`, which rotor it has, and how many there are of the
// integrator. Where `WITH_BODIES` is in the place of `OURS`, there are others behind these: of how many atoms the fix line does not
// tell the body any more, and three numbers of each. They are not in LAMMPS's state of atoms: command replicate refuses atoms that
// have one from a restart file, and a fix of another style does not get it. LAMMPS's own rigid fixes may be given them, because a suffix is not part of the style's name there: of two zeros they
// take nothing.

class Restart : public Part {
 public:
  using Part::Part;

  // Whether restart files have a state of this fix.

  void announce() const { fix->restart_global = has_state() || bridge.follows_atoms; }

  // The size in bytes, for LAMMPS, then numbers. Rank 0 writes them.

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

  // What the file has of bodies, before they are decided.

  void find_bodies() const
  {
    char *state = RestartState::left_by(modify, fix->id, [](const std::string &style, const char *state) {
      return writes(style) && is_ours(state) && number(state, MARK) == WITH_BODIES;
    });
    if (!state) return;
    const int rows = BEFORE + (int) number(state, SIZE);
    bridge.kept_rows = (int32_t) number(state, rows);
    bridge.kept_bodies = reinterpret_cast<double *>(state) + rows + 1;
  }

  // The integrator's first number says what the others are.

  void read(const char *state) const
  {
    const int size = bridge.restart_size;
    if (is_ours(state)) {
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

  // LAMMPS gives a fix the state that one of its ID and style has left. One of another style of ours may have left it, too.

  void take_over() const
  {
    char *state = RestartState::left_by(modify, fix->id, [this](const std::string &other, const char *state) {
      if (!writes(other) || other == fix->style || !is_ours(state)) return false;
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

  static bool writes(const std::string &style)
  {
    return style == PYTHON_MOVE || replaces(style) || std::count(std::begin(NATIVE), std::end(NATIVE), style);
  }

  static double number(const char *state, int k)
  {
    double found;
    memcpy(&found, state + k * sizeof found, sizeof found);
    return found;
  }

  // The state of another fix may end behind two numbers.

  static bool is_ours(const char *state)
  {
    return number(state, 0) == 0.0 && number(state, 1) == 0.0 && (number(state, MARK) == OURS || number(state, MARK) == WITH_BODIES);
  }
};

}    // namespace nosquish
}    // namespace

#endif
