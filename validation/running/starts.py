"""Starts of any size, built once and kept; and from the atoms that an earlier run has left."""

import os
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from ..scenes import Scene
from . import run
from .machine import contents

STATE = "x y z ix iy iz vx vy vz"  # of an atom, all that a run goes on from
EXACT = "sort id format float %.17g"  # of a dump: to the last bit


def of_size(scene: Scene, bodies: int, folder: Path) -> Scene:
    """The scene with so many bodies; its data file is built if there is none yet.

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
    """LAMMPS commands that dump all atoms every so many steps, for `from_dump`."""
    return [f'dump state all custom {every} "{dump}" id {STATE}', f"dump_modify state {EXACT}"]


def read(dump: Path | str, step: int, dimension: int = 3, box: bool = False) -> str:
    """The LAMMPS command that gives the atoms of a scene what a dump of them all has.

    The counter of steps stays: the step only tells which snapshot of the dump is meant.

    Args:
        dimension: in two LAMMPS refuses what is said of z.
        box: whether the box becomes that of the dump, too.
    """
    fields = STATE if dimension == 3 else " ".join(one for one in STATE.split() if "z" not in one)
    sized = "yes" if box else "no"
    return f'read_dump "{dump}" {step} {fields} box {sized} replace yes timestep no format native'


def from_dump(scene: Scene, dump: Path | str, step: int, box: bool = False) -> Scene:
    """The scene with positions, images and velocities from a dump of all atoms.

    Args:
        box: see `read`.
    """
    return replace(scene, setup=(*scene.setup, read(dump, step, scene.dimension, box)))
