/* What differs between versions of LAMMPS, 29 Aug 2024 to 4 Jul 2026, or is not in the headers that LAMMPS installs.
   COMPILED_FOR_LAMMPS is the version as a number, 20250722 for 22 Jul 2025, and is tested only here. Headers that only a source tree
   has are used if they are found. */

#ifndef FIX_NOSQUISH_LAMMPS_VERSIONS_H
#define FIX_NOSQUISH_LAMMPS_VERSIONS_H

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "exceptions.h"
#include "fix.h"
#include "input.h"
#include "lammps.h"
#include "modify.h"
#include "universe.h"
#include "update.h"
#include "utils.h"
#include "variable.h"

#include <cstdint>
#include <cstring>
#include <string>

// The members of a min style that are used. Its header is not installed; these are the members of 4 Feb 2025 to 4 Jul 2026.

#if __has_include("min.h")
#include "min.h"
struct Minimizer : LAMMPS_NS::Min {
  using Min::dmax;
  using Min::normstyle;
};
#else
struct Minimizer : LAMMPS_NS::Pointers {
  double results[8];
  int counts[3];
  char *stopstr;
  int searchflag, flags[4];
  double dmax;
  int linestyle, normstyle;
};
#endif

// A molecule template, and the address of its numbers `center`, `masstotal`, `com` and `itensor`, which follow each other; null for a
// version whose class was not read. Its header is not among the installed ones.

#if __has_include("molecule.h")
#include "molecule.h"
inline const double *properties_of(const LAMMPS_NS::Molecule *molecule)
{
  return molecule->center;
}
#else
namespace LAMMPS_NS {
class Molecule {
 public:
  void compute_center();
  void compute_mass();
  void compute_com();
  void compute_inertia();
};
}    // namespace LAMMPS_NS

inline const double *properties_of(const LAMMPS_NS::Molecule *molecule)
{
  const int others = COMPILED_FOR_LAMMPS <= 20250722 ? 696 : COMPILED_FOR_LAMMPS == 20260704 ? 792 : 0;
  const auto center = reinterpret_cast<const char *>(molecule) + others + sizeof(std::string);    // one of the members before it
  return others ? reinterpret_cast<const double *>(center) : nullptr;
}
#endif

// The current command, which is protected before 2025.

struct CurrentCommand : LAMMPS_NS::Input {
  static const char *of(LAMMPS_NS::Input *input) { return input->*(&CurrentCommand::command); }
};

// LAMMPS does not evaluate a vector-style variable again in the same step, although atoms may have moved since. The members that make it
// do so are private.

#if COMPILED_FOR_LAMMPS <= 20250722
template <auto member> struct PrivateMember {
  friend auto vectors_of(LAMMPS_NS::Variable &variable) { return variable.*member; }
};
auto vectors_of(LAMMPS_NS::Variable &);
template struct PrivateMember<&LAMMPS_NS::Variable::vecs>;

inline int number_of(LAMMPS_NS::Variable &variable)
{
  return variable.nvar;
}

inline void forget_vectors(LAMMPS_NS::Variable &variable)
{
  for (int k = 0; k < number_of(variable); k++)
    if (variable.vectorstyle(k)) vectors_of(variable)[k].currentstep = -1;
}
#else
struct Variables : LAMMPS_NS::Variable {
  static auto &of(LAMMPS_NS::Variable &variable) { return variable.*(&Variables::variables); }
};

inline int number_of(LAMMPS_NS::Variable &variable)
{
  return (int) Variables::of(variable).size();
}

inline void forget_vectors(LAMMPS_NS::Variable &variable)
{
  for (auto &entry : Variables::of(variable)) {
    entry.vec.currentstep = -1;
    if (!entry.vec.values) entry.vec.nmax = 0;    // 4 Jul 2026 keeps that of a variable that is defined again, and writes to no memory
  }
}
#endif

// The bits of KOKKOS for the arrays that a rigid body changes; all bits for a version whose header was not read.

#if __has_include("atom_masks.h")
#include "atom_masks.h"
#elif COMPILED_FOR_LAMMPS <= 20250722
enum : uint64_t { X_MASK = 1, V_MASK = 2, MU_MASK = 1 << 18, OMEGA_MASK = 1 << 22, ANGMOM_MASK = 1 << 24 };
#elif COMPILED_FOR_LAMMPS == 20260704
enum : uint64_t { X_MASK = 1, V_MASK = 2, MU_MASK = 1 << 17, OMEGA_MASK = 1ULL << 35, ANGMOM_MASK = 1ULL << 37 };
#else
enum : uint64_t { X_MASK = ~0ULL, V_MASK = X_MASK, MU_MASK = X_MASK, OMEGA_MASK = X_MASK, ANGMOM_MASK = X_MASK };
#endif

inline uint64_t changed_arrays(const LAMMPS_NS::Atom *atom)
{
  return X_MASK | V_MASK | (atom->omega_flag ? OMEGA_MASK : 0) | (atom->angmom_flag ? ANGMOM_MASK : 0) | (atom->mu_flag ? MU_MASK : 0);
}

// The states of fixes in the restart file that was read.

struct RestartState : LAMMPS_NS::Modify {
  // mark the first state of a fix with this ID for which wanted(style, state) holds as used, and return it; null if there is none
  template <typename Wanted> static char *find(LAMMPS_NS::Modify *modify, const char *id, Wanted wanted)
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

// The structure that registers a style: from lammpsplugin.h, which is not installed and is the same in all versions. The creator is a
// union there.

struct lammpsplugin_t {
  const char *version, *style, *name, *info, *author;
  void *(*creator)(void *lmp, int narg, char **arg);
  void *handle;
};

// End the run on all ranks as Error::all does, without naming a source file. Since 2025 LAMMPS can point at the wrong argument of its
// command.

[[noreturn]] inline void end_on_all(LAMMPS_NS::LAMMPS *lmp, const std::string &text, int argument = -1)
{
  using namespace LAMMPS_NS;
  MPI_Barrier(lmp->world);
  std::string message = "ERROR: " + text + "\n";
#if COMPILED_FOR_LAMMPS >= 20250204
  message += utils::point_to_error(lmp->input, argument < 0 ? Error::NOPOINTER : argument);
#else
  const char *command = CurrentCommand::of(lmp->input);
  message += std::string("Last command: ") + (command ? command : "") + "\n";
#endif
  if (lmp->comm->me == 0) utils::logmesg(lmp, message);
  utils::flush_buffers(lmp);
  lmp->update->whichflag = 0;    // so that Python can continue
  if (lmp->universe->nworlds > 1) throw LAMMPSAbortException(message, lmp->universe->uworld);
  throw LAMMPSException(message);
}

#endif
