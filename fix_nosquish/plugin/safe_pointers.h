/* Stands in for a header of LAMMPS that 4 Jul 2026 does not install: variable.h includes it, for a class that the plugin does not use. */

#ifndef FIX_NOSQUISH_SAFE_POINTERS_H
#define FIX_NOSQUISH_SAFE_POINTERS_H

namespace LAMMPS_NS {
class SafeFilePtr {};
}

#endif
