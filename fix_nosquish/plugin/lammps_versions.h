/* What differs between versions of LAMMPS, 29 Aug 2024 to 22 Jul 2025 and newer. COMPILED_FOR_LAMMPS is the version as a number,
   20250722 for 22 Jul 2025: what needs more than one way is chosen by it, here and nowhere else. */

#ifndef FIX_NOSQUISH_LAMMPS_VERSIONS_H
#define FIX_NOSQUISH_LAMMPS_VERSIONS_H

#include "input.h"

// The command that is being read; only classes derived from Input may see it before 2025.

struct CurrentCommand : LAMMPS_NS::Input {
  static const char *of(LAMMPS_NS::Input *input) { return input->*(&CurrentCommand::command); }
};

#endif
