"""Comparisons of fix_nosquish with LAMMPS's own rigid and constraint fixes.

Run from the checkout: ``python -m validation --help``.  Data flows one way:

    scenes, integrators   what is simulated, and by which fix: data, LAMMPS's words
    run -> worker         one LAMMPS run in processes of its own; what it left behind
    lammps_log, measures  from log text and arrays to numbers with errors
    compare               a verb: which runs, in which order, which measures
    figures, report       from numbers to PNG, CSV, JSON and HTML
    __main__, console     command line, progress and table in the terminal

    bench                 a verb: what is measured, kept, and not measured again; it uses
    rounds, passes        runs timed in turn; the optional passes of a step
    startup, bandwidth    what a start costs; what the memory allows
    counting              messages
    goals                 what is to be reached, as data
    bench_figures, bench_report

    scaling               a verb: what ranks send each other, counted, and a model; with counting, scaling_report
    longrun               a verb: one free body for very many steps
    motion                of longrun and stability: dumps of atoms, and what bodies without forces keep

    check                 of paper and theory: a number beside its bounds, its verdict, a table of such

    paper                 a verb: the paper's test problems run again; it uses
    paper_peptide         what only the peptide has: constraints, zeros of energy, helix
    paper_claims          from trajectories to numbers, errors, verdicts
    paper_figures, paper_report

    sweep                 a verb: error against run time, every integrator with every step; it uses
    sweep_plan            which points there are, how long they run, what a budget allows
    starts                starts of any size, and from what an earlier run has left
    sweep_errors          from runs to errors with margins, limits of short steps
    sweep_structure       what a run's atoms tell
    sweep_choice, sweep_figures, sweep_report
    advise                a verb: the fastest point of a sweep that meets a target

    theory                a verb: what the paper proves, each a number between bounds; it uses
    theory_reversal       runs of LAMMPS forward and back
    theory_reference      the schemes written straight from the paper's equations
    theory_calculus       Jacobians, brackets, recursions
    theory_top            the exact motion of a free top
    theory_report

    stability             a verb: what breaks where, case by case; it uses
    stability_cases       the list of cases, which are in
    stability_molecules, stability_tops, stability_contact
    stability_bodies      small scenes of bodies
    criteria              every bound, what it is derived from, and each change of it
    stability_report

    breaks                a verb: what users report of LAMMPS's rigid fixes, beside ours; with breaks_report
    boxes                 of breaks, and of the tests: small boxes of Lennard-Jones bodies

    published             a verb: the energy's spread in water beside published numbers

    report                a verb: all results on one page; it uses overview, overview_report

A new scene is an entry in ``scenes.py``, a new integrator one in
``integrators.py``; a new verb is a module beside ``compare.py``.
"""

import os
import sys

# Python looks into the checkout last: what is measured is the fix_nosquish that is installed
_CHECKOUT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
sys.path[:] = [place for place in sys.path if os.path.realpath(place) != _CHECKOUT] + [_CHECKOUT]
