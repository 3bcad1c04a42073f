"""Estimates from the forces at the start: at which time step a run is unstable, and the error of
averages at shorter ones."""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

from . import shapes, thermostat
from .commands import split_words
from .loader import UserScript
from .shapes import BodyGroup

# frequency x step above which runs fail: less than Verlet's 2, because the frequency is a mean and
# some bodies move faster.  Estimated step, and steps at which runs went on and failed or heated:
#   TIP3P 11 fs, 10 and 12; the peptide 4.6 fs, 5 and 6; liquid nitrogen 36 fs, 40 and 60;
#   benzene of six LJ sites 31 fs, - and 40; SF6 43 fs, - and 50; octahedra (LJ) 0.043 τ, 0.02 and
#   0.04; raspberries of 13 spheres (WCA) 0.06 τ, 0.05 and 0.065.
# Without `Motion.contacts` the estimates of the last five are 2.7 to 9 times as long
UNSTABLE = {"centres": 1.5, "turning": 1.3, "other atoms": 1.5}
# relative error of the temperatures of translation and rotation, over the mean square of frequency
# x step of all degrees of freedom.  With csvr and nh in TIP3P water 0.8 % at 4 fs, 1.4 % at 6 fs,
# 3 % at 8 fs: 0.094, 0.073, 0.090.  Friction reduces it, where it is faster than the exchange
# between translation and rotation: at 8 fs 2.2 % (1/ps), 1.1 % (5/ps) and 0.25 % (20/ps)
ERROR, EXCHANGE = 0.085, 4.0  # 1/ps
PICOSECONDS = {"real": 1e-3, "metal": 1.0}  # of the units of time
TOLERANCE = 0.01  # of the temperature, as in compare
LISTS = "neigh_modify every 1 delay 0 check yes"


def stiffest(script: UserScript) -> float:
    """The largest angular frequency (1/time) by mean squares of the forces at the start; 0 without
    any.  It leaves out contacts, of which a start that is not in equilibrium may have many."""
    motions = shapes.motions(script, shapes.body_groups(script)[0])
    return max((motion.square**0.5 for part in motions.values() for motion in part), default=0.0)


def error_coefficient(script: UserScript, groups: Sequence[BodyGroup]) -> float:
    """The estimated relative error of temperatures over the square of the step, with the script's
    thermostat."""
    friction, state = 0.0, script.rigid.state
    if thermostat.kind_of(script.rigid.lines) == "langevin" and state.temp:
        ps = PICOSECONDS.get(script.scene.units)
        friction = 1 / (float(state.temp[2]) * ps) if ps else 0.0
    return ERROR / (1 + friction / EXCHANGE) * shapes.mean_square_frequency(script, groups)


def lists_in_time(commands: Iterable[str]) -> list[str]:
    """The command with which LAMMPS checks neighbour lists in every step, if the script's settings
    differ: these were sufficient for its step, but not for a longer one."""
    settings = {"every": "1", "delay": "0", "check": "yes"}
    for words in map(split_words, commands):
        if words[0] == "neigh_modify":
            settings |= {key: value for key, value in pairwise(words) if key in settings}
    every, delay, check = settings.values()
    return [] if (every, delay) == ("1", "0") and check in ("yes", "on", "true") else [LISTS]


def with_lists_in_time(script: UserScript, tell: Callable[[str], object] = print) -> UserScript:
    """The script with `LISTS`, if its own settings differ.

    Args:
        tell: is called with a note if the script is changed.
    """
    lines = lists_in_time(script.reading["commands"])
    if not lines:
        return script
    note = (
        f"'{LISTS}' is added, because with longer steps atoms may come within the cutoff before "
        "LAMMPS looks at its neighbour lists by your own setting."
    )
    return script.changed(note, tell, then=(*script.scene.then, *lines))
