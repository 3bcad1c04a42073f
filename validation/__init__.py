"""Comparisons of fix_nosquish with LAMMPS's own rigid and constraint fixes.

Run ``nosquish --help``.  These rooms import no verb, and of each other only those that
stand before them:

    statistics    from series and atoms to numbers with errors, and numbers between bounds
    scenes        what is simulated and by which fix: scenes, integrators, data files
    schemes       the older schemes, as LAMMPS imports them
    running       LAMMPS in processes of its own, in turn or counted; starts; the store of results
    pages         what a verb says of its results, in the terminal, in files and on a page
    own           a user's script as a scene: LAMMPS reads it

``experiment`` is what all verbs share: points, trajectories, and the loop that runs them.

A verb is a folder with ``command`` (its words), ``plan`` (what runs), ``measure`` (from runs to
numbers), ``figures`` and ``report``, whose function ``describe`` returns the `Report` on a summary:

    compare       which integrator and time step reach an accuracy the fastest
    sample        what averages cost with their error; barostats and other engines, too
    stress        what breaks, and where
    claims        whether what the paper and we say holds
    cost          what the fix costs: time, memory, messages, start-up
    check         whether a user's script is sound, and which parts of it can be rigid
    report        all results on one page

A new verb is a folder whose ``command.py`` has ``add(verbs)``; it is found by that.
"""

import sys
from pathlib import Path

INSTALLED = "fix_nosquish_validation"  # what pip installs the folder as; LAMMPS imports that
NAME = __name__
COMMAND = "nosquish"
FOLDER = Path(__file__).resolve().parent


def _checkout() -> Path:
    """The checkout that has the built-in scenes and the committed results: pip installs neither.

    An installed harness takes the one that the working folder is in.
    """
    if FOLDER.name != INSTALLED:
        return FOLDER.parent
    for folder in Path.cwd(), *Path.cwd().parents:
        if (folder / "inputs" / "water").is_dir() and (folder / "validation").is_dir():
            return folder
    return FOLDER.parent


CHECKOUT = _checkout()
INPUTS = CHECKOUT / "inputs"
RESULTS = CHECKOUT / "validation" / "results"

if FOLDER.name != INSTALLED:
    # Python looks into the checkout last: what is measured is the fix_nosquish that is installed
    others = [place for place in sys.path if Path(place).resolve() != CHECKOUT]
    sys.path[:] = [*others, str(CHECKOUT)]
