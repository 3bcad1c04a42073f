/* What all parts of the fix have in common. */

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

// A part sees LAMMPS, the fix that it belongs to, and what this fix shares with Python.

class Part : protected Pointers {
 public:
  Part(LAMMPS *lmp, Fix *fix, Bridge &bridge) : Pointers(lmp), fix(fix), bridge(bridge) {}

  // End the run on all ranks, all of which call this.
  [[noreturn]] void refuse(const std::string &text) const { end_on_all(lmp, problem(fix, text)); }

  void warn(const std::string &text) const { log(("WARNING: " + problem(fix, text)).c_str()); }

  // Lines for screen and log. Warnings among them are counted, and left out, as thermo_modify warn has it of LAMMPS's own.

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
