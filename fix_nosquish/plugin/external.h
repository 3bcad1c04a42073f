/* External forces on bodies (fix_modify external): what the words are in a step, and who tells LAMMPS their energy and virial. */

#ifndef FIX_NOSQUISH_EXTERNAL_H
#define FIX_NOSQUISH_EXTERNAL_H

#include "error.h"
#include "fix.h"
#include "input.h"
#include "modify.h"
#include "variable.h"

#include <algorithm>
#include <string>
#include <vector>

// LAMMPS keeps the values of a vector-style variable as long as the step is the same, though atoms may have moved since, between
// runs or to where they were, and the variable may be another one of the same number. Only its own classes may have it forget.

template <auto member> struct Private {
  friend auto vectors_of(LAMMPS_NS::Variable &variable) { return variable.*member; }
};
auto vectors_of(LAMMPS_NS::Variable &);
template struct Private<&LAMMPS_NS::Variable::vecs>;

inline void forget_vectors(LAMMPS_NS::Variable &variable)
{
  const auto vectors = vectors_of(variable);
  for (int k = 0; k < variable.nvar; k++)
    if (variable.vectorstyle(k) && vectors[k].dynamic) vectors[k].currentstep = -1;
}

// The fix of which LAMMPS takes energy and virial of external forces, where fix_modify external says so: the scalar of the fix
// that moves the bodies is another one. It has that fix's ID, with _external.

class ExternalForces : public LAMMPS_NS::Fix {
 public:
  double energy = 0.0;

  ExternalForces(LAMMPS_NS::LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
  {
    scalar_flag = extscalar = global_freq = energy_global_flag = virial_global_flag = 1;
  }
  int setmask() override { return 0; }
  double compute_scalar() override { return energy; }
  void take(const double *told)
  {
    energy = told[0];
    std::copy_n(told + 1, 6, virial);
  }

  // in the place of the one that there is, if there is one
  static void replace(LAMMPS_NS::Modify *modify, const std::string &id, bool tells_energy, bool tells_virial)
  {
    if (modify->get_fix_by_id(id)) modify->delete_fix(id);
    if (!tells_energy && !tells_virial) return;
    const std::string style = "nosquish/external";    // known to LAMMPS for this moment: no script makes one
    (*modify->fix_map)[style] = [](LAMMPS_NS::LAMMPS *lmp, int narg, char **arg) -> Fix * { return new ExternalForces(lmp, narg, arg); };
    Fix *made = modify->add_fix(id + " all " + style, 0);
    modify->fix_map->erase(style);
    made->thermo_energy = tells_energy;
    made->thermo_virial = tells_virial;
  }
};

// What a word is now: a number (and 0 is returned), or one for each body (and so many). A column is that of a vector-style variable.

inline int values_of(const std::string &word, const std::string &own, LAMMPS_NS::Variable &variable, LAMMPS_NS::Error *error,
                     std::vector<double> &values)
{
  const bool column = word[0] != 'v';
  if (column) variable.set(own + " vector " + word);
  forget_vectors(variable);
  const std::string name = column ? own : word.substr(2);
  const int number = variable.find(name.c_str());
  int count = 0;
  if (number >= 0 && variable.vectorstyle(number)) {
    double *first = nullptr;
    count = variable.compute_vector(number, &first);
    values.insert(values.end(), first, first + count);
  } else if (number >= 0 && variable.equalstyle(number)) {
    values.push_back(variable.compute_equal(number));
  } else {
    error->all(FLERR, "fix_modify external: " + word + (number < 0 ? ": there is no such variable" : " is of a variable of another style") +
                          ": define it with 'variable " + name + " equal ...' or 'variable " + name + " vector ...'");
  }
  if (column) variable.set(own + " delete");
  return count;
}

#endif
