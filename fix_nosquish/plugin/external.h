/* External forces on bodies (fix_modify external): the values of its words, and a fix with their energy and virial. */

#ifndef FIX_NOSQUISH_EXTERNAL_H
#define FIX_NOSQUISH_EXTERNAL_H

#include "lammps_versions.h"
#include "part.h"

#include "input.h"
#include "modify.h"
#include "update.h"
#include "variable.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

namespace {
namespace nosquish {

// A fix from which LAMMPS takes energy and virial of external forces, if fix_modify external asks for it. The scalar of the fix that
// moves the bodies is another quantity. Its ID is that of this fix and _external.

class ExternalForces : public Fix {
 public:
  double energy = 0.0;

  ExternalForces(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
  {
    scalar_flag = extscalar = global_freq = energy_global_flag = virial_global_flag = 1;
  }
  int setmask() override { return 0; }
  double compute_scalar() override { return energy; }
  void set(const double *energy_and_virial)
  {
    energy = energy_and_virial[0];
    std::copy_n(energy_and_virial + 1, 6, virial);
  }

  // make such a fix, or none; delete the previous one
  static void replace(Modify *modify, const std::string &id, bool counts_energy, bool counts_virial)
  {
    if (dynamic_cast<ExternalForces *>(modify->get_fix_by_id(id))) modify->delete_fix(id);
    if (!counts_energy && !counts_virial) return;
    const std::string style = "nosquish/external";    // registered only here, so that no script can use it
    (*modify->fix_map)[style] = [](LAMMPS *lmp, int narg, char **arg) -> Fix * { return new ExternalForces(lmp, narg, arg); };
    Fix *reporter = modify->add_fix(id + " all " + style, 0);
    modify->fix_map->erase(style);
    reporter->thermo_energy = counts_energy;
    reporter->thermo_virial = counts_virial;
  }
};

// Python interprets the words of fix_modify external; LAMMPS evaluates the variables among them in each step.

class External : public Part {
 public:
  double energy_and_virial[7] = {};    // energy, and virial on this rank

  using Part::Part;

  ~External() override
  {
    if (bridge.words && modify->nfix) ExternalForces::replace(modify, id(), false, false);
  }

  // The words after fix_modify external.

  std::string words_of(int narg, char **arg) const
  {
    Fix *other = modify->get_fix_by_id(id());
    if (other && !dynamic_cast<ExternalForces *>(other))
      refuse("fix " + id() + " (style " + other->style + ") has the ID that external forces need: give it another ID");
    return utils::join_words({arg + 1, arg + narg}, " ");
  }

  // After Python has interpreted the words.

  void replace_fix() const { ExternalForces::replace(modify, id(), bridge.counts_energy, bridge.counts_virial); }

  // Evaluate the words.

  void evaluate()
  {
    std::istringstream words(bridge.words ? bridge.words : "");
    values.clear();
    sizes.clear();
    modify->clearstep_compute();
    forget_vectors(*input->variable);
    for (std::string word; words >> word;) sizes.push_back(add(word));
    forget_vectors(*input->variable);    // they may be of velocities within a step
    modify->addstep_compute(update->ntimestep + 1);
    bridge.values = values.data();
    bridge.sizes = sizes.data();
  }

  // Pass energy and virial from Python to LAMMPS.

  void report() const
  {
    if (!bridge.counts_energy && !bridge.counts_virial) return;
    const auto reporter = dynamic_cast<ExternalForces *>(modify->get_fix_by_id(id()));
    if (!reporter) refuse("fix " + id() + " is gone, which has the energy and virial of external forces: remove the unfix");
    reporter->set(energy_and_virial);
  }

 private:
  std::vector<double> values;    // of all words
  std::vector<int> sizes;

  std::string id() const { return std::string(fix->id) + "_external"; }

  // Append the value of a word, v_NAME: one number (returns 0), or one for each body (returns how many).

  int add(const std::string &word)
  {
    Variable &variable = *input->variable;
    const std::string name = word.substr(2);
    const int number = variable.find(name.c_str());
    int count = 0;
    if (number >= 0 && variable.vectorstyle(number)) {
      double *first = nullptr;
      count = variable.compute_vector(number, &first);
      values.insert(values.end(), first, first + count);
    } else if (number >= 0 && variable.equalstyle(number)) {
      values.push_back(variable.compute_equal(number));
    } else {
      end_on_all(lmp, "fix_modify external: " + word +
                     (number < 0 ? ": there is no such variable" : " is of a variable of another style") +
                     ": define it with 'variable " + name + " equal ...' or 'variable " + name + " vector ...'");
    }
    return count;
  }
};

}    // namespace nosquish
}    // namespace

#endif
