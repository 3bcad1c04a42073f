/* The state of the integrator in LAMMPS's restart files. */

#ifndef FIX_NOSQUISH_RESTART_H
#define FIX_NOSQUISH_RESTART_H

#include "lammps_versions.h"
#include "part.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace {
namespace nosquish {

// Before the integrator's numbers stand five of the fix: two zeros, `OURS`, which rotor it has, and how many there are of the
// integrator. LAMMPS's own rigid fixes may be given them, because a suffix is not part of the style's name there: of two zeros they
// take nothing.

class Restart : public Part {
 public:
  using Part::Part;

  // Whether restart files have a state of this fix.

  void announce() const { fix->restart_global = bridge.restart_size > 0 || bridge.rotor >= 0; }

  // The size in bytes, for LAMMPS, then numbers. Rank 0 writes them.

  void write(FILE *file) const
  {
    if (comm->me) return;
    const double begin[BEFORE] = {0.0, 0.0, OURS, (double) bridge.rotor, (double) bridge.restart_size};
    const int bytes = sizeof begin + bridge.restart_size * sizeof(double);
    fwrite(&bytes, sizeof(int), 1, file);
    fwrite(begin, sizeof begin, 1, file);
    fwrite(bridge.restart_state, sizeof(double), bridge.restart_size, file);
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
      const bool ours = other == PYTHON_MOVE || replaces(other) || std::count(std::begin(NATIVE), std::end(NATIVE), other);
      return ours && other != fix->style && is_ours(state) && (fix->restart_global || number(state, ROTOR) >= 0);
    });
    if (!state) return;
    read(state);
    if (comm->me == 0) utils::logmesg(lmp, problem(fix, "it goes on from the state of its ID in the restart file\n"));
  }

 private:
  enum { ROTOR = 3, SIZE = 4, BEFORE = 5 };
  static constexpr double OURS = 4.929e-49;

  static double number(const char *state, int k)
  {
    double found;
    memcpy(&found, state + k * sizeof found, sizeof found);
    return found;
  }

  // The state of another fix may end behind two numbers.

  static bool is_ours(const char *state) { return number(state, 0) == 0.0 && number(state, 1) == 0.0 && number(state, 2) == OURS; }
};

}    // namespace nosquish
}    // namespace

#endif
