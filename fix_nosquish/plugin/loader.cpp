/* The shared object that LAMMPS loads: it loads the plugin beside it if that was compiled for this LAMMPS. With another version the
   linker would only print the name of a missing function. Only LAMMPS's library interface is used here. */

#include "library.h"
#include "lmptype.h"

#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <mpi.h>
#include <string>

namespace {

// The plugin depends on the layout of LAMMPS's classes, so on the version of its headers. For a patched LAMMPS see layout.h.

bool compiled_for(void *lmp)
{
  return lammps_version(lmp) == COMPILED_FOR_LAMMPS &&
      lammps_config_has_mpi_support() == sizeof(MPI_Comm) &&
      lammps_extract_setting(nullptr, "bigint") == sizeof(LAMMPS_NS::bigint) &&
      lammps_extract_setting(nullptr, "tagint") == sizeof(LAMMPS_NS::tagint) &&
      lammps_extract_setting(nullptr, "imageint") == sizeof(LAMMPS_NS::imageint);
}

}    // namespace

extern "C" void lammpsplugin_init(void *lmp, void *handle, void *enter)
{
  std::string problem = "its plugin was compiled for LAMMPS " + std::to_string(COMPILED_FOR_LAMMPS) + ", and this is " +
      std::to_string(lammps_version(lmp)) + " or has other sizes of integers or another MPI";
  if (compiled_for(lmp)) {
    Dl_info here;
    dladdr(reinterpret_cast<void *>(&compiled_for), &here);
    std::string path = here.dli_fname;
    path.erase(path.rfind("plugin"), 6);    // python_move.so
    // it is never unloaded, because Python's callbacks are called until the process ends
    if (void *plugin = dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL | RTLD_NODELETE))
      return reinterpret_cast<decltype(&lammpsplugin_init)>(dlsym(plugin, "lammpsplugin_init"))(lmp, handle, enter);
    problem = dlerror();
  }
  const char *obstacle = getenv("FIX_NOSQUISH_OBSTACLE");
  problem = obstacle ? obstacle : problem + ", so it is not used. Install fix_nosquish again for this LAMMPS: see docs/install.md";
  problem += ". Until then LAMMPS does not know its fixes, and with '-sf nosquish' uses its own";
  if (!lammps_extract_setting(lmp, "world_rank")) fprintf(stderr, "fix_nosquish: %s\n", problem.c_str());
}
