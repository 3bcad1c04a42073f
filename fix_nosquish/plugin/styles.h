/* The names of the styles, and messages that contain them. */

#ifndef FIX_NOSQUISH_STYLES_H
#define FIX_NOSQUISH_STYLES_H

#include "fix.h"

#include <algorithm>
#include <string>

namespace {
namespace nosquish {
using namespace LAMMPS_NS;

const std::string PYTHON_MOVE = "python/move";
const std::string NATIVE[] = {"nosquish/nve", "nosquish/nvt", "nosquish/npt", "nosquish/nph", "nosquish/hmc"};

const std::string PAIRS = "nosquish/pairs";

// The styles and computes that replace LAMMPS's with -sf nosquish.

const std::string SUFFIX = "/nosquish";
const std::string REPLACED[] = {"rigid",           "rigid/nve",       "rigid/nvt",       "rigid/npt",       "rigid/nph",
                                "rigid/small",     "rigid/nve/small", "rigid/nvt/small", "rigid/npt/small", "rigid/nph/small"};
const std::string COMPUTES[] = {"rigid/local", "ke/rigid", "erotate/rigid"};

// Aliases: nosquish/nvt/small for nosquish/nvt, and nosquish/rigid/nvt for rigid/nvt/nosquish.

const std::string OURS = "nosquish/", SMALL = "/small";

std::string style_meant(const std::string &name)
{
  if (name.rfind(OURS + "rigid", 0) == 0) return name.substr(OURS.size()) + SUFFIX;
  return name.rfind(OURS, 0) == 0 ? name.substr(0, name.rfind(SMALL)) : name;
}

bool replaces(const std::string &style)
{
  return style.rfind("rigid", 0) == 0;
}

// A message with the ID and style of the fix. LAMMPS adds the suffix to the style only after the constructor.

std::string problem(const Fix *fix, const std::string &text)
{
  std::string name = fix->style;
  if (replaces(name) && name.find(SUFFIX) == std::string::npos) name += SUFFIX;
  return "Fix " + std::string(fix->id) + " " + name + ": " + text;
}

// The message for a class of LAMMPS whose layout is not that of its header.

std::string another_class(const std::string &name)
{
  return "this LAMMPS has another class " + name +
      " than the headers with which fix_nosquish's plugin was compiled, although the version is the same: it was built with other "
      "options or patches. Compile the plugin again, in a checkout of fix_nosquish: pip install --force-reinstall --no-deps . "
      "with NOSQUISH_LAMMPS set to the source tree or the install folder of this LAMMPS (see docs/own-lammps.md)";
}

const char PAPER[] = "fix nosquish: https://doi.org/10.1063/1.1473654\n\n"
                     "@Article{Miller2002,\n"
                     " author = {Miller, T. F. and Eleftheriou, M. and Pattnaik, P. and Ndirango, A. and Newns, D. and Martyna, G. J.},\n"
                     " title = {Symplectic quaternion scheme for biophysical molecular dynamics},\n"
                     " journal = {J. Chem. Phys.},\n"
                     " volume = 116,\n"
                     " pages = {8649--8659},\n"
                     " year = 2002\n"
                     "}\n\n";

}    // namespace nosquish
}    // namespace

#endif
