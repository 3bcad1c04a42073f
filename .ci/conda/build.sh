#!/usr/bin/env bash
# Install the package for the LAMMPS in PREFIX, so that an activated environment finds the plugin.
set -euo pipefail
export NOSQUISH_LAMMPS=$PREFIX NOSQUISH_MPI=$PREFIX/bin/mpicxx
"$PYTHON" -m pip install -v --no-deps --no-build-isolation .
mkdir -p "$PREFIX/etc/conda/activate.d" "$PREFIX/etc/conda/deactivate.d"
# shellcheck disable=SC2016  # the shell that activates the environment expands it
echo 'eval "$("$CONDA_PREFIX/bin/python" -m fix_nosquish.plugin)"' \
    > "$PREFIX/etc/conda/activate.d/fix_nosquish.sh"
echo 'unset LAMMPS_PLUGIN_PATH FIX_NOSQUISH_PYTHON' > "$PREFIX/etc/conda/deactivate.d/fix_nosquish.sh"
