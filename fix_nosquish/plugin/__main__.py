"""Print the environment variables by which a LAMMPS of your own finds the plugin.

eval "$(python -m fix_nosquish.plugin)"
"""

import shlex

from . import PYTHON, plugin_folder, python

print(f"export LAMMPS_PLUGIN_PATH={shlex.quote(plugin_folder()[0])}")
print(f"export {PYTHON}={shlex.quote(python())}")
