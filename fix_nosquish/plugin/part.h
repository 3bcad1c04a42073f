/* The base class of the parts of the fix. */

#ifndef FIX_NOSQUISH_PART_H
#define FIX_NOSQUISH_PART_H

#include "bridge.h"
#include "lammps_versions.h"
#include "styles.h"

#include "comm.h"
#include "error.h"
#include "fix.h"
#include "pointers.h"

#include <string>

namespace {
namespace nosquish {

// A part of the fix has access to LAMMPS, to the fix, and to what the fix shares with Python.

class Part : protected Pointers {
 public:
  Part(LAMMPS *lmp, Fix *fix, Bridge &bridge) : Pointers(lmp), fix(fix), bridge(bridge) {}

  // End the run on all ranks. Collective.
  [[noreturn]] void refuse(const std::string &text) const { end_on_all(lmp, problem(fix, text)); }

  void warn(const std::string &text) const { log(("WARNING: " + problem(fix, text)).c_str()); }

  // Write lines to screen and log. Warnings are counted and suppressed as set by thermo_modify warn.

  void log(const char *text) const
  {
    if (comm->me) return;
    for (const auto &line : utils::split_lines(text)) {
      if (line.rfind("WARNING", 0) == 0) {
        const int most = error->get_maxwarn(), count = error->get_numwarn() + 1;
        error->set_numwarn(count);
        if (most != 0 && (most < 0 || count > most)) continue;
      }
      utils::logmesg(lmp, line + "\n");
    }
  }

 protected:
  Fix *const fix;
  Bridge &bridge;
};

}    // namespace nosquish
}    // namespace

#endif
