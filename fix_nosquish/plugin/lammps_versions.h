/* What differs between versions of LAMMPS, 29 Aug 2024 to 22 Jul 2025 and newer. COMPILED_FOR_LAMMPS is the version as a number,
   20250722 for 22 Jul 2025: what needs more than one way is chosen by it, here and nowhere else. */

#ifndef FIX_NOSQUISH_LAMMPS_VERSIONS_H
#define FIX_NOSQUISH_LAMMPS_VERSIONS_H

#include "error.h"
#include "input.h"
#include "modify.h"

#include <cstring>
#include <string>

// The command that is being read; only classes derived from Input may see it before 2025.

struct CurrentCommand : LAMMPS_NS::Input {
  static const char *of(LAMMPS_NS::Input *input) { return input->*(&CurrentCommand::command); }
};

// What fixes have left in the restart file that was read.

struct RestartState : LAMMPS_NS::Modify {
  // a wanted state of a fix with this ID, which is then used; null if there is none: wanted(style, state)
  template <typename Wanted> static char *left_by(LAMMPS_NS::Modify *modify, const char *id, Wanted wanted)
  {
    for (int k = 0; k < modify->nfix_restart_global; k++) {
      if (strcmp((modify->*(&RestartState::id_restart_global))[k], id) != 0) continue;
      if (!wanted((modify->*(&RestartState::style_restart_global))[k], (modify->*(&RestartState::state_restart_global))[k])) continue;
      (modify->*(&RestartState::used_restart_global))[k] = 1;
      return (modify->*(&RestartState::state_restart_global))[k];
    }
    return nullptr;
  }
};

// End the run on all ranks; since 2025 LAMMPS can point at the argument of its command that is wrong.

[[noreturn]] inline void all_at_argument(LAMMPS_NS::Error *error, int argument, const std::string &text)
{
#if COMPILED_FOR_LAMMPS >= 20250204
  if (argument >= 0) error->all(FLERR, argument, text);
#endif
  error->all(FLERR, text);
}

#endif
