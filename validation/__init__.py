"""Comparisons of fix_nosquish with LAMMPS's own rigid and constraint fixes.

Run ``python -m validation --help``.  Below are rooms that import no verb, and of each other only
those that stand before them:

    statistics    from series and atoms to numbers with errors, and numbers beside bounds
    scenes        what is simulated and by which fix: scenes, integrators, data files
    schemes       the older schemes, as LAMMPS imports them: classes of one's own
    running       LAMMPS in processes of its own, in turn or counted; starts; the store of results
    pages         tables, figures, HTML pages and the terminal, as all reports share them
    own           a user's script as a scene: reading, finding, integrators

Above is a room for each verb, with the same few files: ``plan`` (what runs), ``measure`` (from runs
to numbers), ``figures``, ``report`` (files, terminal, and what it says to the page of all verbs; a
long one is in ``section``) and ``command`` (its words, and its entry):

    compare       which integrator, which step, and what it costs
    long          one free body for very many steps
    cost          what a step, a start, memory and messages cost; goals, passes
    paper         the paper's test problems again
    published     the energy's spread in water beside published numbers
    ensembles     what long steps sample at constant temperature and pressure
    sampling      what averages cost with long steps: bias, noise, time to an error
    engines       the same water in OpenMM and GROMACS: bias of averages
    theory        what the paper proves, each a number between bounds
    check         before a long run of a user's script: bodies, step, fixes
    bodies        rigid parts of molecules, into a data file
    stability     what breaks where, case by case; criteria has every bound
    breaks        what users report of LAMMPS's rigid fixes, beside ours
    examples      LAMMPS's examples with -sf nosquish, beside its own rigid fixes
    report        all results on one page

A new scene is an entry in ``scenes/__init__.py``, a new integrator one in
``scenes/integrators.py``, a new measure a function in ``statistics/measures.py`` (of series) or
``statistics/structure.py`` (of atoms).  A new verb is a folder beside ``compare`` whose
``command.py`` has ``add(verbs)``; it is found by that.
"""

import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
INPUTS = CHECKOUT / "inputs"
RESULTS = CHECKOUT / "validation" / "results"  # those that come with the checkout
INSTALLED = "fix_nosquish_validation"  # what pip installs the folder as; LAMMPS imports that
NAME = __name__
COMMAND = f"python -m {NAME}"

if Path(__file__).resolve().parent.name != INSTALLED:
    # Python looks into the checkout last: what is measured is the fix_nosquish that is installed
    others = [place for place in sys.path if Path(place).resolve() != CHECKOUT]
    sys.path[:] = [*others, str(CHECKOUT)]
