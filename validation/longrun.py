"""A free body for very many steps: what rounding errors do to energy, momentum and shape.

Without forces everything is known: the kinetic energy and both momenta are constant.  The splitting of
the rotation keeps the energy up to a term that falls with dt^2 and does not grow; everything else
may change by rounding only.  Two time steps show both: one so short that the dt^2 term is below the
bound, and one as long as in practice.

The numbers come from the atoms that LAMMPS dumps, for its own fixes as for ours.
"""

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from rich.box import SIMPLE_HEAD  # noqa: E402
from rich.table import Table  # noqa: E402

from validation import machine, measures, motion, run  # noqa: E402
from validation.figures import INK, OTHERS, OURS, STYLE, THIRD  # noqa: E402
from validation.integrators import INTEGRATORS  # noqa: E402

BOUND = 1e-10
FRAMES = 1000
ANGLES = {
    "short": 3e-6,
    "practical": 0.05,
}  # radians that the body turns about in a step, of each time step
NAMES = "nosquish", "rigid/nve", "rigid"
MASS = np.array([1.0, 1.6, 0.4, 1.0, 1.6])
PLACE = np.array([[0, 0, 0], [0.9, 0.1, 0], [-0.2, 0.7, 0.1], [0.1, -0.3, 0.8], [-0.6, -0.4, -0.2]])
SPIN = np.array([0.6, -0.5, 0.7])  # radians per time unit; not along a principal axis
VELOCITY = np.array([0.013, -0.021, 0.017])
QUANTITIES = {
    "energy": "kinetic energy",
    "angular_momentum": "angular momentum",
    "momentum": "momentum",
    "shape": "distances between atoms",
}


class _Scene:
    """The words of the fix lines."""

    group, bodies, constraints = "all", "single", ""


def long_run(out, steps, names, meter, silence):
    """Run, or take over what is there already, and measure.

    Args:
        out: folder for the runs and results.  steps: of each run.  names: of `NAMES`.
        meter: a ``console.Meter``.
    Returns:
        (rows, series): a dict for each run, and for each the relative errors against the steps.
    """
    folder = Path(out) / "runs"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.body").write_text(_data())
    rows, series = [], {}
    for kind, angle in ANGLES.items():
        for name in names:
            label = f"{INTEGRATORS[name].label}, {kind} step"
            directory = folder / f"{run.folder_name(name)}-{kind}"
            meter.begin(label, steps)
            result = run.once(
                _job(
                    directory,
                    folder,
                    INTEGRATORS[name],
                    angle / np.linalg.norm(SPIN),
                    steps,
                    silence,
                ),
                meter.at,
            )
            meter.end(result.error)
            row = {
                "name": name,
                "label": INTEGRATORS[name].label,
                "step": kind,
                "angle": angle,
                "error": result.error,
            }
            errors = _errors(directory)
            if len(errors["steps"]):
                row["steps"] = int(errors["steps"][-1])
                row |= {key: float(np.abs(errors[key]).max()) for key in QUANTITIES}
                if len(errors["steps"]) > 20:
                    row["energy_drift"] = measures.drift(
                        errors["steps"] / errors["steps"][-1], errors["energy"]
                    ).plain()
                if result.timings:
                    row["us_per_step"] = (
                        result.timings[0]["loop"] / result.timings[0]["steps"] * 1e6
                    )
            rows.append(row)
            series[label] = errors
            _save(rows, out)
            if result.interrupted:
                return rows, series
    return rows, series


def _job(directory, folder, integrator, dt, steps, silence):
    return run.Job(
        directory=str(directory), folder=str(folder.resolve()), runs=[steps], body_property="molecule", silence=silence,
        commands=[
            "units lj", "atom_style molecular", "atom_modify map yes", "read_data data.body", "pair_style zero 2.0", "pair_coeff * *",
            "neighbor 1.0 bin", f"timestep {dt:.17g}", *integrator.commands(_Scene),
            *(line.format(folder=directory.resolve()) for line in motion.dump(max(1, steps // FRAMES))),
            "thermo_style custom step", f"thermo {max(1, steps // 200)}", "thermo_modify flush yes",
        ],
    )  # fmt: skip


def _data():
    """LAMMPS data file of the body, in motion."""
    place = PLACE - MASS @ PLACE / MASS.sum()
    velocity = VELOCITY + np.cross(SPIN, place)
    kinds = np.unique(MASS)
    lines = ["a free asymmetric body", "", f"{len(MASS)} atoms", f"{len(kinds)} atom types", ""]
    lines += [f"-10 10 {c}lo {c}hi" for c in "xyz"]
    lines += [
        "",
        "Masses",
        "",
        *(f"{k + 1} {m}" for k, m in enumerate(kinds)),
        "",
        "Atoms # molecular",
        "",
    ]
    lines += [
        f"{i + 1} 1 {np.searchsorted(kinds, MASS[i]) + 1} "
        + " ".join(f"{c:.17g}" for c in place[i])
        for i in range(len(MASS))
    ]
    lines += [
        "",
        "Velocities",
        "",
        *(f"{i + 1} " + " ".join(f"{c:.17g}" for c in velocity[i]) for i in range(len(MASS))),
        "",
    ]
    return "\n".join(lines)


def _errors(folder):
    """Relative errors of what is constant, from a run's dump: steps (frames,), and for each of QUANTITIES (frames,)."""
    if not motion.has_frames(folder):
        return {"steps": np.empty(0), **{key: np.empty(0) for key in QUANTITIES}}
    steps, mass, x, v = motion.frames(folder)
    energy, momentum, angular = motion.conserved(mass, x, v)
    distance = motion.distances(x)
    return {
        "steps": steps,
        "energy": energy / energy[0] - 1,
        "angular_momentum": np.linalg.norm(angular - angular[0], axis=1)
        / np.linalg.norm(angular[0]),
        "momentum": np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0]),
        "shape": np.abs(distance / distance[0] - 1).max(axis=1),
    }


def _save(rows, out):
    (Path(out) / "summary.json").write_text(
        json.dumps(machine.circumstances() | {"bound": BOUND, "runs": rows}, indent=1) + "\n"
    )
    flat = [
        row
        | (
            {"energy_drift": row["energy_drift"]["value"], "energy_drift_margin": _margin(row)}
            if "energy_drift" in row
            else {}
        )
        for row in rows
    ]
    pd.DataFrame(flat).to_csv(Path(out) / "table.csv", index=False, float_format="%.3g")


def _margin(row):
    return measures.Estimate(**row["energy_drift"]).margin


def show(console, rows):
    """Print the table; ± is the half width of the 95 % interval."""
    table = Table(
        title=f"Largest relative error of a free body (bound {BOUND:g})",
        title_justify="left",
        box=SIMPLE_HEAD,
    )
    for column in (
        "integrator",
        "turn a step, rad",
        "steps",
        *QUANTITIES.values(),
        "drift of energy in the run",
        "µs/step",
    ):
        table.add_column(column, justify="left" if column == "integrator" else "right")
    for row in rows:
        if "steps" in row:
            table.add_row(
                row["label"], f"{row['angle']:g}", f"{row['steps']:,}", *(f"{row[key]:.1e}" for key in QUANTITIES),
                f"{row['energy_drift']['value']:.1e} ± {_margin(row):.0e}" if "energy_drift" in row else "–", f"{row.get('us_per_step', np.nan):.1f}",
            )  # fmt: skip
        if row["error"]:
            console.print(f"✗ {row['label']}: {row['error']}", markup=False)
    console.print(table)


def draw(rows, series, out):
    """Relative errors against steps, log-log, a column for each time step; path of the PNG."""
    colours = dict(zip(NAMES, (OURS, OTHERS, THIRD)))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(QUANTITIES),
            len(ANGLES),
            figsize=(10, 9),
            sharex=True,
            sharey="row",
            layout="constrained",
        )
        for row in rows:
            errors = series[f"{row['label']}, {row['step']} step"]
            column = list(ANGLES).index(row["step"])
            for axis, key in zip(axes[:, column], QUANTITIES):
                # the largest error so far: what a user has to reckon with
                worst = np.maximum.accumulate(np.abs(errors[key]))
                axis.loglog(
                    errors["steps"][1:],
                    np.maximum(worst[1:], 1e-17),
                    color=colours[row["name"]],
                    label=row["label"],
                )
        for line, (key, what) in zip(axes, QUANTITIES.items()):
            line[0].set_ylabel(what)
            for axis in line:
                axis.axhline(BOUND, color=INK, lw=0.8, ls=":")
        for axis, (kind, angle) in zip(axes[0], ANGLES.items()):
            axis.set_title(f"{kind} step: {angle:g} rad", loc="left")
        axes[0, 0].legend(frameon=False)
        figure.supxlabel("steps")
        figure.supylabel("largest relative error so far")
        path = Path(out) / "long-run.png"
        figure.savefig(path)
        plt.close(figure)
    return path
