/* Computes rigid/local/nosquish, ke/rigid/nosquish and erotate/rigid/nosquish: LAMMPS's computes of these names for the fixes of this
   plugin. */

#ifndef FIX_NOSQUISH_COMPUTES_H
#define FIX_NOSQUISH_COMPUTES_H

#include "fix_nosquish.h"

namespace {
namespace nosquish {

class ComputeOfBodies : public Compute {
 public:
  ComputeOfBodies(LAMMPS *lmp, int narg, char **arg) : Compute(lmp, narg, arg)
  {
    local_flag = std::string(style).rfind("rigid/local", 0) == 0;
    which = std::string(style).rfind("erotate", 0) == 0;
    if (local_flag ? narg < 5 : narg != 4)
      end_on_all(lmp, problem(local_flag ? "expected the ID of a fix and values" : "expected the ID of a fix, and nothing else"));
    bodies = arg[3];
    const std::vector<std::string> names(arg + 4, arg + std::max(4, narg));
    for (const auto &word : names)
      if (!std::count(VALUES.begin(), VALUES.end(), word))
        end_on_all(lmp, problem("'" + word + "' is not a value of a body: expected some of " + utils::join_words(VALUES, ", ")));
    words = utils::join_words(names, " ");
    size_local_cols = narg == 5 ? 0 : narg - 4;
    scalar_flag = extscalar = !local_flag;
  }

  void init() override
  {
    find();
    size_local_rows = 0;    // the bodies may not exist yet
  }

  double compute_scalar() override
  {
    invoked_scalar = update->ntimestep;
    return scalar = find()->kinetic_energy(which);
  }

  void compute_local() override
  {
    invoked_local = update->ntimestep;
    const int columns = std::max(1, size_local_cols);
    size_local_rows = find()->rows_of_rank(words.c_str(), groupbit, vector_local);
    rows.resize(size_local_rows);
    for (int k = 0; k < size_local_rows; k++) rows[k] = vector_local + k * columns;
    array_local = rows.data();
  }

 private:
  inline static const std::vector<std::string> VALUES = {"id", "mol", "mass", "x", "y", "z", "xu", "yu", "zu", "vx", "vy", "vz", "fx", "fy", "fz",
      "ix", "iy", "iz", "tqx", "tqy", "tqz", "omegax", "omegay", "omegaz", "angmomx", "angmomy", "angmomz",
      "quatw", "quati", "quatj", "quatk", "inertiax", "inertiay", "inertiaz"};
  std::string bodies, words;
  int which;
  std::vector<double *> rows;

  std::string problem(const std::string &text) const { return "Compute " + std::string(id) + " " + style + ": " + text; }

  FixNosquish *find() const
  {
    Fix *other = modify->get_fix_by_id(bodies);
    if (!other) end_on_all(lmp, problem("there is no fix " + bodies));
    auto ours = dynamic_cast<FixNosquish *>(other);
    if (!ours)
      end_on_all(lmp, problem("fix " + bodies + " (style " + other->style + ") is no fix of fix_nosquish. For one of "
                                "LAMMPS's own define the compute with the suffix off"));
    return ours;
  }
};

Compute *make_compute(LAMMPS *lmp, int narg, char **arg)
{
  return new ComputeOfBodies(lmp, narg, arg);
}

}    // namespace nosquish
}    // namespace

#endif
