"""Matplotlib figures from a summary and its series."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

OURS, OTHERS, THIRD, INK, PALE = "#0b6e4f", "#5b7db1", "#c06c3e", "#333333", "#bdbdbd"
STYLE = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "savefig.dpi": 150,
    "savefig.bbox": "tight",
}


def draw(summary, series, out):
    """All figures of a comparison that there are numbers for: see `draw_each`."""
    return draw_each((energy, cost), out, summary, series)


def draw_each(functions, out, *data):
    """Draw figures into a folder, each by a function of the data that gives (figure or None, caption).

    Returns:
        list of (PNG path, caption).
    """
    made = []
    with plt.rc_context(STYLE):
        for function in functions:
            figure, caption = function(*data)
            if figure is not None:
                path = Path(out) / f"{function.__name__}.png"
                figure.savefig(path)
                plt.close(figure)
                made.append((path, caption))
    return made


def _colour(row):
    return OURS if row["name"] == "nosquish" else OTHERS


def energy(summary, series):
    """Total energy minus its start against time, one panel for each integrator."""
    rows = [row for row in summary["integrators"] if len(series.get(row["name"], {})) > 0]
    if not rows:
        return None, ""
    settings = summary["settings"]
    begin = settings["discarded_fraction"] * settings["steps"]
    curves = {}
    for row in rows:
        table = series[row["name"]]
        kept = np.isfinite(table["TotEng"])
        time, total = table["Time"][kept] / 1000, table["TotEng"][kept]
        used = table["Step"][kept] >= begin
        level = total[used][:10].mean() if used.any() else total[:1].sum()
        curves[row["name"]] = time, total - level, used
    reach = [np.abs(e).max() for _, e, _ in curves.values() if len(e)]
    limit = 1.15 * min(max(reach), 2.5 * np.median(reach)) if reach else 1.0
    columns = 2 if len(rows) > 1 else 1
    lines = -(-len(rows) // columns)
    figure, axes = plt.subplots(
        lines,
        columns,
        figsize=(10, 1.0 + 1.45 * lines),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for axis in axes.flat[len(rows) :]:
        axis.set_visible(False)
        axes[lines - 2, columns - 1].tick_params(labelbottom=True)
    for axis, row in zip(axes.flat, rows):
        time, error, used = curves[row["name"]]
        axis.axhline(0, color=PALE, lw=1, zorder=0)
        axis.plot(time[~used], error[~used], color=PALE, lw=1)
        axis.plot(time[used], error[used], color=_colour(row), lw=0.9)
        axis.set_title(row["label"], loc="left", fontsize=10, fontweight="bold", pad=3)
        if "energy_sd" in row:
            sd, slope = row["energy_sd"], row["drift"]
            note = (
                f"sd {sd['value']:.3g}, drift {slope['value']:+.3g} ± {slope['error']:.2g} per ps"
            )
            axis.set_title(note, loc="right", fontsize=8.5, pad=3)
        notes = ["not completed"] * bool(row["error"])
        notes += ["leaves the frame"] * bool(len(error) and np.abs(error).max() > limit)
        axis.text(0.99, 0.05, ", ".join(notes), transform=axis.transAxes, ha="right", color="#b00")
    axes[0, 0].set_ylim(-limit, limit)
    figure.supxlabel("time (ps)", fontsize=10)
    figure.supylabel("total energy − its start (kcal/mol)", fontsize=10)
    return figure, (
        f"Change of the total energy, {settings['dt_fs']:g} fs steps, all panels on the same "
        "scale; zero is the mean of the first ten samples kept. The pale start is left out of all "
        "averages."
    )


def cost(summary, series):
    """Time in Modify: median, minimum and maximum of the timed segments."""
    rows = [row for row in summary["integrators"] if row.get("modify")]
    if not rows:
        return None, ""
    rows.sort(key=lambda row: row["modify"]["median"])
    places = np.arange(len(rows))
    values = np.array([[row["modify"][key] for key in ("median", "min", "max")] for row in rows]).T
    median, low, high = values
    figure, axis = plt.subplots(figsize=(8.5, 0.9 + 0.45 * len(rows)), layout="constrained")
    axis.barh(places, median, color=[_colour(row) for row in rows], height=0.62)
    axis.errorbar(
        median, places, xerr=[median - low, high - median], fmt="none", ecolor=INK, capsize=3, lw=1
    )
    for place, row, top in zip(places, rows, high):
        ratio = row.get("modify_ratio")
        text = f"{row['modify']['median']:.0f}" + (f"  ({ratio['median']:.2f}×)" if ratio else "")
        axis.annotate(text, (top, place), (6, 0), textcoords="offset points", va="center")
    axis.set_yticks(places, [row["label"] for row in rows])
    axis.tick_params(axis="y", length=0)
    axis.invert_yaxis()
    axis.set_xlim(0, high.max() * 1.22)
    axis.set_xlabel("time in LAMMPS's Modify (µs per step)")
    settings = summary["settings"]
    return figure, (
        f"Time in the fixes on {settings['ranks']} rank(s): median of {settings['timing_rounds']} "
        "interleaved segments, whiskers from minimum to maximum; in brackets the ratio to "
        f"{settings['reference']}."
    )
