"""Print what a shell must set, so that a LAMMPS that is no Python package finds the plugin.

eval "$(python -m fix_nosquish.plugin)"
"""

import os
import shlex
import sys

from . import PYTHON, _libpython, _plugin_folder

print(f"export LAMMPS_PLUGIN_PATH={shlex.quote(_plugin_folder())}")
print(f"export {PYTHON}={shlex.quote(os.pathsep.join((sys.executable, _libpython())))}")
