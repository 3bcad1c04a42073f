/* What Python asks about other fixes, and about LAMMPS where its library interface does not answer. */

#ifndef FIX_NOSQUISH_OTHER_FIXES_H
#define FIX_NOSQUISH_OTHER_FIXES_H

#include "part.h"

#include "compute.h"
#include "force.h"
#include "group.h"
#include "input.h"
#include "kspace.h"
#include "library.h"
#include "modify.h"
#include "variable.h"

#include <string>

namespace {
namespace nosquish {
using namespace FixConst;

class OtherFixes : public Part {
 public:
  using Part::Part;

  // Describe fix number n; returns false after the last. This fix is described without ID.

  bool describe(int n, void *description) const
  {
    if (n >= modify->nfix) return false;
    const int between = POST_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | POST_NEIGHBOR | PRE_FORCE | PRE_REVERSE | POST_FORCE |
        POST_INTEGRATE_RESPA | PRE_FORCE_RESPA | POST_FORCE_RESPA;
    const int early_hooks = INITIAL_INTEGRATE | POST_INTEGRATE | INITIAL_INTEGRATE_RESPA | POST_INTEGRATE_RESPA;
    Fix *other = modify->fix[n];
    auto hooks = [mask = modify->fmask[n]](int some) { return (mask & some) != 0; };
    *static_cast<FixDescription *>(description) = !other || other == fix
        ? FixDescription()
        : FixDescription{other->id, other->style, other->groupbit, other->time_integrate, hooks(between), hooks(END_OF_STEP), other->nevery,
                   hooks(INITIAL_INTEGRATE | FINAL_INTEGRATE | INITIAL_INTEGRATE_RESPA | FINAL_INTEGRATE_RESPA), (other->box_change & ~Fix::BOX_CHANGE_DOMAIN) != 0,    // ranks' parts of the box are not the box
                   hooks(~0), other->dof_flag && !other->time_integrate, other->energy_global_flag,
                   other->energy_global_flag && other->thermo_energy, hooks(POST_FORCE), other->virial_global_flag,
                   other->virial_global_flag && other->thermo_virial, hooks(early_hooks) && !other->time_integrate,
                   varies(other)};
    return true;
  }

  // Whether the fix may depend on variables. Fix efield allocates memory if it does; fix deform and fix balance do not tell.

  bool varies(Fix *other) const
  {
    auto is = [other](const char *style) { return utils::strmatch(other->style, style); };
    Variable &variable = *input->variable;
    bool depends = is("^deform/") || (is("^efield") && other->memory_usage() > 0.0);
    for (int k = 0; k < number_of(variable); k++)
      depends |= (is("^deform") && variable.equalstyle(k)) || (is("^balance") && variable.atomstyle(k));
    return depends;
  }

  // The degrees of freedom that another fix removes by constraints. A fix that integrates may not know them yet.

  int64_t removed_freedom(const char *id, const char *group_id) const
  {
    Fix *other = modify->get_fix_by_id(id);
    const int number = group->find(group_id);
    return other && other->dof_flag && !other->time_integrate && number >= 0 ? other->dof(number) : 0;
  }

  void begin_step_of(const char *id) const
  {
    if (Fix *other = modify->get_fix_by_id(id)) other->initial_integrate(0);
  }

  int64_t gravity(const char *id) const
  {
    int dimension;
    Fix *other = modify->get_fix_by_id(id);
    void *acceleration = other ? other->extract("gvec", dimension) : nullptr;
    if (acceleration && modify->find_fix(id) > modify->find_fix(fix->id)) {    // it has not initialized its variables yet
      other->init();
      other->setup(0);
    }
    return reinterpret_cast<int64_t>(acceleration);
  }

  bool pair_style(const char *first) const { return force->pair_match(std::string("^") + first, 0, 1); }

  const char *last_command()
  {
    const char *first = CurrentCommand::of(input);
    command = first ? first : "";
    for (int k = 0; first && k < input->narg; k++) command += std::string(" ") + input->arg[k];
    return command.c_str();
  }

  // Some computes of LAMMPS cast each fix whose style begins with rigid to LAMMPS's own class.

  void refuse_casts() const
  {
    for (const auto &other : modify->get_compute_list())
      for (const auto &name : COMPUTES)
        if (replaces(fix->style) && name == other->style)
          refuse("compute " + std::string(other->id) + " (style " + name + ") is LAMMPS's own, which works only with LAMMPS's own rigid fixes: "
                 "define it with the suffix on, or write " + name + SUFFIX);
  }

 private:
  std::string command;
};

}    // namespace nosquish
}    // namespace

#endif
