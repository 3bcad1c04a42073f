"""The package for Spack: its folder in a repository of packages is py_fix_nosquish (with the older
form of repositories py-fix-nosquish).  What was run of it: docs/own-lammps.md."""

from spack.package import *


class PyFixNosquish(PythonPackage):
    """NO_SQUISH rigid-body integration inside LAMMPS, written in Python."""

    license("GPL-2.0-or-later")
    version("1.0.0")

    depends_on("cxx", type="build")
    depends_on("python@3.10:", type=("build", "run"))
    depends_on("py-setuptools@77:", type="build")
    depends_on("py-numba@0.66:", type="build")
    depends_on("py-llvmlite@0.48:", type="build")
    depends_on("py-numpy@1.23.5:", type=("build", "run"))
    depends_on("py-mpi4py@4.1:", type=("build", "run"))
    depends_on("mpi", type=("build", "link", "run"))
    depends_on("lammps@20240829: +plugin+mpi+lib", type=("build", "link", "run"))

    def setup_build_environment(self, env):
        env.set("NOSQUISH_LAMMPS", self.spec["lammps"].prefix)
        env.set("NOSQUISH_MPI", self.spec["mpi"].mpicxx)

    def setup_run_environment(self, env):  # what python -m fix_nosquish.plugin prints
        python = self.spec["python"]
        words = python.command.path, python.libs[0], str(python.version.up_to(2))
        env.set("FIX_NOSQUISH_PYTHON", ":".join(words))
        plugin = join_path(python_platlib, "fix_nosquish", "plugin", "for_own")
        env.prepend_path("LAMMPS_PLUGIN_PATH", join_path(self.prefix, plugin))
