/* How LAMMPS learns of the styles: its lammpsplugin.h is not among the installed headers. */

#ifndef FIX_NOSQUISH_REGISTRATION_H
#define FIX_NOSQUISH_REGISTRATION_H

#include "computes.h"
#include "layout.h"

namespace {
namespace nosquish {

struct lammpsplugin_t {
  const char *version, *style, *name, *info, *author;
  void *(*creator)(void *lmp, int narg, char **arg);    // a union there, with other creators than those of fixes
  void *handle;
};

// This code relies on the layout of LAMMPS's classes, so on the very version whose headers it saw. What it can use of that version
// without these, the library interface, it uses to see whether that LAMMPS was built of the same headers: see layout.h.

bool compiled_for(void *lmp)
{
  return lammps_version(lmp) == COMPILED_FOR_LAMMPS &&
      lammps_config_has_mpi_support() == sizeof(MPI_Comm) &&
      lammps_extract_setting(nullptr, "bigint") == sizeof(bigint) &&
      lammps_extract_setting(nullptr, "tagint") == sizeof(tagint) &&
      lammps_extract_setting(nullptr, "imageint") == sizeof(imageint);
}

// Before anything relies on the layout of LAMMPS's classes.

void refuse_other_layout(LAMMPS *lmp, const std::string &style)
{
  const char *obstacle = getenv("FIX_NOSQUISH_OBSTACLE"), *differs = obstacle ? nullptr : Layout(lmp).differs();
  if (!obstacle && !differs) return;
  const std::string text = "Fix " + style + ": " + (obstacle ? obstacle : another_class(differs));
  if (Layout(lmp).lammps()) lmp->error->all(FLERR, text);
  lammps_error(lmp, LMP_ERROR_ALL, text.c_str());
}

void *make(void *lmp, int narg, char **arg)
{
  refuse_other_layout(static_cast<LAMMPS *>(lmp), arg[2]);
  return static_cast<Fix *>(new FixPythonMove(static_cast<LAMMPS *>(lmp), narg, arg));
}

// Python's callbacks and the end of the process come back to this code: it must not go. On Linux, the linker's flag sees to it.

void stay_loaded()
{
#ifdef __APPLE__
  Dl_info here;
  if (dladdr(reinterpret_cast<void *>(&stay_loaded), &here)) dlopen(here.dli_fname, RTLD_NOW | RTLD_NODELETE);
#endif
}

}    // namespace nosquish
}    // namespace

extern "C" void lammpsplugin_init(void *pointer, void *handle, void *regfunc)
{
  using namespace nosquish;
  if (!compiled_for(pointer)) {
    if (lammps_extract_setting(pointer, "world_rank")) return;
    if (const char *obstacle = getenv("FIX_NOSQUISH_OBSTACLE"))
      fprintf(stderr, "fix_nosquish: %s\n", obstacle);
    else
      fprintf(stderr,
              "fix_nosquish: its plugin was compiled for LAMMPS %d, and this is %d or has other sizes of integers or another "
              "MPI, so it is not used. Install fix_nosquish again for this LAMMPS: see docs/install.md\n",
              COMPILED_FOR_LAMMPS, lammps_version(pointer));
    return;
  }
  stay_loaded();
  name_python_early();
  const auto lmp = static_cast<LAMMPS *>(pointer);
  const Layout layout(lmp);
  const auto enter = reinterpret_cast<void (*)(lammpsplugin_t *, void *)>(regfunc);
  lammpsplugin_t plugin{layout.lammps() ? lmp->version : "", "fix", PYTHON_MOVE.c_str(), "fixes nosquish/* and python/move",
                        "fix_nosquish", make, handle};
  enter(&plugin, lmp);
  const bool alike = layout.styles();
  std::vector<std::string> styles(std::begin(NATIVE), std::end(NATIVE));
  for (const auto &name : REPLACED)
    for (const char *accelerated : {"", "/omp"}) styles.push_back(name + accelerated + SUFFIX);
  for (const auto &name : styles) {
    plugin.name = name.c_str();
    // the same without a line of the log for each
    if (alike) (*lmp->modify->fix_map)[name] = reinterpret_cast<Modify::FixCreator>(make);
    else enter(&plugin, lmp);
  }
  if (!alike) return;    // each fix says why
  for (const auto &name : COMPUTES) (*lmp->modify->compute_map)[name + SUFFIX] = make_compute;
}

#endif
