/* Registers the styles. */

#ifndef FIX_NOSQUISH_REGISTRATION_H
#define FIX_NOSQUISH_REGISTRATION_H

#include "computes.h"
#include "../pairs/fix_pairs.h"
#include "layout.h"

namespace {
namespace nosquish {

// Called before anything depends on the layout of LAMMPS's classes.

void refuse_other_layout(LAMMPS *lmp, const std::string &style)
{
  const char *obstacle = getenv("FIX_NOSQUISH_OBSTACLE"), *differs = obstacle ? nullptr : Layout(lmp).differs();
  if (!obstacle && !differs) return;
  const std::string text = "Fix " + style + ": " + (obstacle ? obstacle : another_class(differs));
  if (Layout(lmp).lammps()) lmp->error->all("fix_nosquish", 0, text);
  lammps_error(lmp, LMP_ERROR_ALL, text.c_str());
}

void *make(void *pointer, int narg, char **arg)
{
  const auto lmp = static_cast<LAMMPS *>(pointer);
  refuse_other_layout(lmp, arg[2]);
  std::string style = style_meant(arg[2]);
  if (style != arg[2] && !lmp->comm->me) utils::logmesg(lmp, "Fix " + std::string(arg[0]) + ": " + arg[2] + " is " + style + "\n");
  std::vector<char *> words(arg, arg + narg);
  words[2] = style.data();
  return static_cast<Fix *>(new FixNosquish(lmp, narg, words.data()));
}

void *make_pairs(void *lmp, int narg, char **arg)
{
  return static_cast<Fix *>(new FixPairs(static_cast<LAMMPS *>(lmp), narg, arg));
}

}    // namespace nosquish
}    // namespace

extern "C" void lammpsplugin_init(void *pointer, void *handle, void *regfunc)
{
  using namespace nosquish;
  name_python_early();
  const auto lmp = static_cast<LAMMPS *>(pointer);
  const Layout layout(lmp);
  const auto enter = reinterpret_cast<void (*)(lammpsplugin_t *, void *)>(regfunc);
  lammpsplugin_t plugin{layout.lammps() ? lmp->version : "", "fix", PYTHON_MOVE.c_str(), "fixes nosquish/* and python/move",
                        "fix_nosquish", make, handle};
  enter(&plugin, lmp);
  const bool alike = layout.styles();
  std::vector<std::string> styles(std::begin(NATIVE), std::end(NATIVE));
  for (const auto &name : NATIVE) styles.push_back(name + SMALL);
  for (const auto &name : REPLACED) styles.insert(styles.end(), {name + SUFFIX, name + "/omp" + SUFFIX, OURS + name});
  for (const auto &name : styles) {
    plugin.name = name.c_str();
    // as `enter`, without a line in the log for each
    if (alike) (*lmp->modify->fix_map)[name] = reinterpret_cast<Modify::FixCreator>(make);
    else enter(&plugin, lmp);
  }
  if (!alike) return;    // the fixes will say why
  (*lmp->modify->fix_map)[PAIRS] = reinterpret_cast<Modify::FixCreator>(make_pairs);
  for (const auto &name : COMPUTES) (*lmp->modify->compute_map)[name + SUFFIX] = make_compute;
}

#endif
