/* What all parts of the fix have in common. */

#ifndef FIX_NOSQUISH_PART_H
#define FIX_NOSQUISH_PART_H

#include "bridge.h"
#include "styles.h"

#include "comm.h"
#include "error.h"
#include "fix.h"
#include "pointers.h"

#include <string>

namespace {
namespace nosquish {

// A part sees LAMMPS, the fix that it belongs to, and what this fix shares with Python.

class Part : protected Pointers {
 public:
  Part(LAMMPS *lmp, Fix *fix, Bridge &bridge) : Pointers(lmp), fix(fix), bridge(bridge) {}

  // End the run on all ranks, all of which call this.
  [[noreturn]] void refuse(const std::string &text) const { error->all(FLERR, problem(fix, text)); }

  void warn(const std::string &text) const
  {
    if (comm->me == 0) error->warning(FLERR, problem(fix, text));
  }

 protected:
  Fix *const fix;
  Bridge &bridge;
};

}    // namespace nosquish
}    // namespace

#endif
