/* Ends a run behind a step, as fix halt does. */

#ifndef FIX_NOSQUISH_HALT_H
#define FIX_NOSQUISH_HALT_H

#include "part.h"

#include "library.h"
#include "timer.h"

#include <cstring>
#include <vector>

namespace {
namespace nosquish {

class Halt : public Part {
 public:
  using Part::Part;
  ~Halt() override { begin_again(); }

  int64_t ask()
  {
    asked = true;
    return 0;
  }

  // At the end of a step, not before: a run that fails then leaves LAMMPS so. Another fix may have ended the run already.

  void end_run() const
  {
    if (!asked) return;
    const bool over = timer->is_timeout();
    const auto bytes = reinterpret_cast<const char *>(timer);
    const std::vector<char> before(bytes, bytes + sizeof(Timer));
    lammps_force_timeout(lmp);
    const bool same = memcmp(before.data(), bytes, sizeof(Timer)) == 0;
    if (!timer->is_timeout() || same != over) refuse(another_class("Timer"));
  }

  // Else no later run would begin.

  void begin_again()
  {
    if (asked) timer->reset_timeout();
    asked = false;
  }

 private:
  bool asked = false;
};

}    // namespace nosquish
}    // namespace

#endif
