/* The state of the integrator in LAMMPS's restart files. */

#ifndef FIX_NOSQUISH_RESTART_H
#define FIX_NOSQUISH_RESTART_H

#include "lammps_versions.h"
#include "part.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace nosquish {

// What stands before the integrator's numbers. LAMMPS's own rigid fixes may be given it, because a suffix is not part of the style's
// name there: of two zeros they take nothing.

struct State {
  double nothing[2] = {0.0, 0.0}, ours = 4.929e-49, rotor = -1.0, size = 0.0;    // of the numbers behind it

  static bool is_in(const char *buffer)
  {
    State found;
    memcpy(found.nothing, buffer, sizeof found.nothing);    // the state of another fix may end here
    if (found.nothing[0] != 0.0 || found.nothing[1] != 0.0) return false;
    return of(buffer).ours == State().ours;
  }

  static State of(const char *buffer)
  {
    State found;
    memcpy(&found, buffer, sizeof found);
    return found;
  }
};

class Restart : public Part {
 public:
  using Part::Part;

  // Whether restart files have a state of this fix.

  void announce() const { fix->restart_global = bridge.restart_size > 0 || bridge.rotor >= 0; }

  // The size in bytes, for LAMMPS, then numbers. Rank 0 writes them.

  void write(FILE *file) const
  {
    if (comm->me) return;
    State begin;
    begin.rotor = bridge.rotor;
    begin.size = bridge.restart_size;
    const int bytes = sizeof begin + bridge.restart_size * sizeof(double);
    fwrite(&bytes, sizeof(int), 1, file);
    fwrite(&begin, sizeof begin, 1, file);
    fwrite(bridge.restart_state, sizeof(double), bridge.restart_size, file);
  }

  // The class's first number says what the others are.

  void read(const char *buffer) const
  {
    const int size = bridge.restart_size;
    if (!State::is_in(buffer)) {
      if (size)
        warn("the restart file has a state for this ID that this fix did not write, as LAMMPS's own rigid fixes do: it is not used, "
             "and thermostat and barostat begin anew");
      return;
    }
    const State begin = State::of(buffer);
    bridge.rotor = (int32_t) begin.rotor;
    if (!size || !begin.size) return;
    const char *numbers = buffer + sizeof begin;
    double kind = 0.0;
    memcpy(&kind, numbers, sizeof(double));
    if (begin.size == size && kind == bridge.restart_state[0]) memcpy(bridge.restart_state, numbers, size * sizeof(double));
    else bridge.restart_state[0] = -1.0;
  }

  // LAMMPS gives a fix the state that one of its ID and style has left. One of another style of ours may have left it, too.

  void take_over() const
  {
    char *state = RestartState::left_by(modify, fix->id, [this](const std::string &other, const char *state) {
      const bool ours = other == PYTHON_MOVE || replaces(other) || std::count(std::begin(NATIVE), std::end(NATIVE), other);
      return ours && other != fix->style && State::is_in(state) && (fix->restart_global || State::of(state).rotor >= 0);
    });
    if (!state) return;
    read(state);
    if (comm->me == 0) utils::logmesg(lmp, problem(fix, "it goes on from the state of its ID in the restart file\n"));
  }
};

}    // namespace nosquish

#endif
