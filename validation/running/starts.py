"""Starts: of any size, built once; and from the atoms of an earlier run."""

import os
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from ..scenes import Scene
from . import run
from .machine import contents

STATE = "x y z ix iy iz vx vy vz"  # of an atom, all that a run continues from
EXACT = "sort id format float %.17g"  # of a dump: to the last bit


def of_size(scene: Scene, bodies: int, folder: Path) -> Scene:
    """The scene with a number of bodies; its data file is built if it does not exist.

    Args:
        folder: for data files.

    Raises:
        SystemExit: the scene's cutter failed.
    """
    if scene.is_whole_copies(bodies):
        return scene.of_size(bodies)
    data = (folder / f"{scene.name}-{bodies}-{contents(scene.folder)[:8]}.data").resolve()
    if not data.exists():
        data.parent.mkdir(parents=True, exist_ok=True)
        part = data.with_suffix(".part")
        cut = sys.executable, str(scene.cutter), str(bodies), str(part)
        command = [*run.launcher(min(4, os.cpu_count() or 1)), *cut]
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            cwd=scene.folder,
            env={"OMP_NUM_THREADS": "1", **os.environ},
        )
        if done.returncode:
            raise SystemExit(
                f"no start of {bodies} bodies: {shlex.join(command)} failed in {scene.folder}"
            )
        part.rename(data)
    return scene.of_size(bodies, data)


def to_dump(dump: Path | str, every: int) -> list[str]:
    """LAMMPS commands that dump all atoms for `from_dump`; ``every``: steps."""
    return [f'dump state all custom {every} "{dump}" id {STATE}', f"dump_modify state {EXACT}"]


def read(dump: Path | str, step: int, dimension: int = 3, box: bool = False) -> str:
    """The LAMMPS command that reads the state of all atoms from a dump.

    The step selects the snapshot; the step counter of LAMMPS stays.

    Args:
        dimension: in two dimensions LAMMPS accepts no z.
        box: whether to take the box of the dump, too.
    """
    fields = (
        STATE if dimension == 3 else " ".join(field for field in STATE.split() if "z" not in field)
    )
    sized = "yes" if box else "no"
    return f'read_dump "{dump}" {step} {fields} box {sized} replace yes timestep no format native'


def from_dump(scene: Scene, dump: Path | str, step: int, box: bool = False) -> Scene:
    """The scene with positions, images and velocities from a dump of all atoms.

    Args:
        box: see `read`.
    """
    return replace(scene, setup=(*scene.setup, read(dump, step, scene.dimension, box)))
