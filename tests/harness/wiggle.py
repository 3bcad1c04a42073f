"""``wiggle``: how the energy of the dimer fluctuates.

An example of a verb, which `test_new_verb.py` adds to the harness: three steps, a table and a page.
"""

from .. import command_line


def add(verbs):
    """Add the verb to the command line."""
    parser = command_line.add_verb(verbs, "wiggle", run, help="how the dimer's energy fluctuates")
    command_line.add_out(parser, "results/wiggle")


def run(arguments):
    """Run the verb; the exit status."""
    from .. import pages
    from ..experiment import Point, Trajectory, perform
    from ..pages import Column, Report, Table, console
    from ..running import machine, run
    from ..running.store import Store
    from ..scenes import SCENES
    from ..scenes.integrators import INTEGRATORS
    from ..statistics import measures

    out, scene, ours = (
        command_line.output_folder(arguments),
        SCENES["dimer"],
        INTEGRATORS["nosquish"],
    )

    def job(dt):
        origin = machine.origin(scene, ours)
        return run.job(scene, ours, out / f"{dt:g}", [2000], dt=dt, every=10, origin=origin)

    steps = 0.1, 0.2, 0.4
    trajectories = [
        Trajectory(f"{dt:g}", f"{dt:g} fs", lambda dt=dt: job(dt), Point("nosquish", dt))
        for dt in steps
    ]
    screen = console.console()
    with console.Meter(screen, 2000 * len(steps)) as meter:
        done = perform(trajectories, Store(out), meter)
    rows = []
    for dt in steps:
        if f"{dt:g}" in done.jobs.keys() - done.failed.keys():
            energy = run.collect(out / f"{dt:g}").thermo["TotEng"]
            rows.append({"dt": dt, "sd": measures.standard_deviation(energy).plain()})
    summary = machine.circumstances() | {"rows": rows, "interrupted": done.interrupted}
    columns = [Column("dt", "step", "fs", "number"), Column("sd", "sd", "kcal/mol", "estimate")]
    report = Report(
        title="The dimer's energy",
        question="How does it fluctuate?",
        answer=f"{len(rows)} steps were measured.",
        tables=[Table("Steps", columns, rows, file="table")],
        failures=[f"{dt} fs: {why}" for dt, why in done.failed.items()],
    )
    pages.publish(screen, report, summary, out)
    return command_line.exit_status(done.interrupted, bool(done.failed))
