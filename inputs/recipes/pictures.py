"""Run the recipes and draw the pictures of their pages.

    python pictures.py FOLDER [NAME ...]

Each recipe runs in a folder of its own in FOLDER, by the commands at the head of its input, unless
that folder is there.  Its picture goes to docs/recipes.  Needs this package with the extra
`validation`.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from fix_nosquish_validation.running import lammps_log
from PIL import Image
from scipy import stats

matplotlib.use("Agg")

HERE = Path(__file__).resolve().parent
PAGES = HERE.parents[1] / "docs" / "recipes"


def commands(name):
    """The commands of a recipe, as its input says them."""
    head = (HERE / name / f"in.{name}").read_text()
    return re.findall(r"^# ((?:lmp|python) .*?)$", head, re.M)


def run(name, folder):
    """Run a recipe in a copy of its folder."""
    shutil.copytree(HERE / name, folder)
    for command in commands(name):
        options = f" -var inputs {HERE.parent}" * command.startswith("lmp")
        subprocess.run(command + options, shell=True, cwd=folder, check=True)


def mean(values, blocks=10):
    """Mean of a series and half the width of its 95 % interval, by means of blocks."""
    parts = [part.mean() for part in np.array_split(np.asarray(values), blocks)]
    return np.mean(parts), stats.t.ppf(0.975, blocks - 1) * stats.sem(parts)


def thermo(folder, name="log.lammps"):
    """Columns of the thermo output of all runs of a log."""
    return lammps_log.thermo((folder / name).read_text())


def dump(path):
    """Columns of the frames of a dump, one behind the other."""
    frames = path.read_text().split("ITEM: TIMESTEP\n")[1:]
    rows = [row.split() for frame in frames for row in frame.splitlines()[8:]]
    return np.array(rows, float)


def solute(folder, left, right):
    """Density, and water around the solute's oxygen."""
    rows = thermo(folder)
    left.plot(rows["Step"] * 2e-3, rows["Density"])
    left.axvline(5.0, color="grey", lw=0.7)
    left.set(xlabel="time, ps", ylabel="density, g/cm³")
    r, g = np.loadtxt(folder / "rdf.txt", skiprows=4, usecols=(1, 2)).T
    right.plot(r, g)
    right.axhline(1.0, color="grey", lw=0.7)
    right.set(xlabel="r, Å", ylabel="g(r), ethanol O – water O", xlim=(2, 9))


def field(folder, left, right):
    """The mean cosine against the Langevin function, and the difference."""
    x = np.linspace(0.1, 8.5, 200)
    left.plot(x, 1 / np.tanh(x) - 1 / x, color="grey", label="coth x − 1/x")
    right.axhline(0.0, color="grey")
    for path in sorted(folder.glob("cosine_*.txt")):
        at = float(path.stem.split("_")[1])
        value, error = mean(np.loadtxt(path)[20:, 1])
        left.plot(at, value, "o", color="C0")
        right.errorbar(at, value - 1 / np.tanh(at) + 1 / at, error, fmt="o", color="C0", capsize=3)
        print(f"field {at}: {value:.4f} ± {error:.4f}, {1 / np.tanh(at) - 1 / at:.4f}")
    left.legend()
    left.set(xlabel="dipole moment × field / kT", ylabel="mean cosine")
    right.set(xlabel="dipole moment × field / kT", ylabel="measured − exact, 95 %")


def diffusion(folder, left, right):
    """Mean squared displacements of five parts, and their slopes."""
    slopes = []
    for part in range(1, 6):
        step, msd = np.loadtxt(folder / f"msd_{part}.txt").T
        time = (step - step[0]) * 3e-3  # ps
        late = time > 1
        left.plot(time, msd, color="C0", lw=0.8)
        slopes.append(10 * np.polyfit(time[late], msd[late], 1)[0] / 6)
    error = stats.t.ppf(0.975, 4) * stats.sem(slopes)
    print(f"diffusion: {np.mean(slopes):.2f} ± {error:.2f} 1e-5 cm²/s")
    left.set(xlabel="time, ps", ylabel="mean squared displacement, Å²")
    right.plot(range(1, 6), slopes, "o")
    right.axhspan(np.mean(slopes) - error, np.mean(slopes) + error, alpha=0.2)
    right.set(xlabel="part of the run", ylabel="slope / 6, 10⁻⁵ cm²/s", ylim=(0, 6))


def peptide(folder, left, right):
    """Density and radius of gyration of the run and its continuation."""
    for name, color in ("log.lammps", "C0"), ("log.continue", "C1"):
        rows = thermo(folder, name)
        time = rows["Step"] * 4e-3
        left.plot(time, rows["Density"], color=color)
        right.plot(time, rows["c_size"], color=color)
    for axes in left, right:
        axes.axvline(6.0, color="grey", lw=0.7)
    left.set(xlabel="time, ps", ylabel="density, g/cm³")
    right.set(xlabel="time, ps", ylabel="radius of gyration of the helix, Å")


def nematic(folder, left, right):
    """The order parameter while the density falls, and the directions at the end."""
    _, rho, xx, yy, zz, xy, xz, yz = np.loadtxt(folder / "order.txt").T
    tensor = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    left.plot(rho, 1.5 * np.linalg.eigvalsh(tensor)[:, 2] - 0.5, ".-")
    left.set(xlabel="density", ylabel="order parameter S", ylim=(0, 1))
    left.invert_xaxis()
    w, x, y, z = dump(folder / "end.dump")[:, 4:].T
    axes = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), w**2 - x**2 - y**2 + z**2], axis=1)
    director = np.linalg.eigh(axes.T @ axes)[1][:, 2]
    right.hist(np.abs(axes @ director), bins=20, range=(0, 1), density=True)
    right.axhline(1.0, color="grey", lw=0.7)
    right.set(xlabel="|cosine| of axis and director", ylabel="probability density at the end")


def shear(folder, left, right):
    """Running means of the viscosity and of the rods' alignment."""
    step, viscosity, along, heat = np.loadtxt(folder / "stress.txt").T
    strain = 0.1 * 0.005 * (step - 2000)
    for axes, values, label in (
        (left, viscosity, "viscosity"),
        (right, along, "mean square, axis along flow"),
    ):
        axes.plot(strain, np.cumsum(values) / np.arange(1, len(values) + 1))
        axes.set(xlabel="strain", ylabel=label)
        print("shear: {}: {:.3f} ± {:.3f}".format(label, *mean(values)))
    right.axhline(1 / 3, color="grey", lw=0.7)
    print(f"shear: temperature {heat.mean():.3f}")


def framework(folder, left, right):
    """Where the molecules are in a cell, and the oxygen around them."""
    left.hist2d(*(dump(folder / "places.dump")[:, 1:3] % 11.867).T, bins=40, cmap="viridis")
    left.set(xlabel="x in a cell, Å", ylabel="y in a cell, Å", aspect="equal")
    r, g = np.loadtxt(folder / "rdf.txt", skiprows=4, usecols=(1, 2)).T
    right.plot(r, g)
    right.set(xlabel="r, Å", ylabel="g(r), C of CO2 – O of LTA")


def second_virial(eps, sigma, cutoff, bond, kt, samples=1_000_000):
    """The second virial coefficient of two-centre molecules, Å³, by random pairs of them."""
    random = np.random.default_rng(1)
    reach = cutoff + bond
    r = random.uniform(0, reach, samples)
    axes = random.normal(size=(2, samples, 3))
    axes *= bond / 2 / np.linalg.norm(axes, axis=2, keepdims=True)
    energy = np.zeros(samples)
    for first in (1, -1):
        for second in (1, -1):
            apart = first * axes[0] - second * axes[1]
            apart[:, 2] += r
            distance = np.linalg.norm(apart, axis=1)
            power = (sigma / distance) ** 6
            energy += np.where(distance < cutoff, 4 * eps * (power**2 - power), 0)
    return np.mean(-2 * np.pi * r**2 * np.expm1(-energy / kt)) * reach


def gas(folder, left, right):
    """The number of molecules, beside the ideal gas and the second virial coefficient."""
    step, number, _ = np.loadtxt(folder / "number.txt").T
    ideal = 4.9346 * 101325 / (1.380649e-23 * 320) * 1e-30  # 1/Å³
    b = second_virial(0.194746, 3.75, 14.0, 1.54, 0.0019872 * 320)
    expected = ideal * 1e6 * (1 - 2 * b * ideal)
    print("gas: {:.1f} ± {:.1f}".format(*mean(number)), f"expected {expected:.1f}, B2 {b:.1f} Å³")
    left.plot(step * 2e-3, number, lw=0.7)
    left.axhline(ideal * 1e6, color="grey", ls=":", label="ideal gas")
    left.axhline(expected, color="C1", label="with B2")
    left.set(xlabel="time, ps", ylabel="molecules")
    left.legend(fontsize="small")
    counts = np.arange(expected // 1 - 35, expected + 35)
    right.hist(number, bins=counts[::4] - 0.5, density=True)
    right.plot(counts, stats.norm.pdf(counts, expected, np.sqrt(expected - 2 * b * ideal**2 * 1e6)))
    right.set(xlabel="molecules", ylabel="probability")


def swimmers(folder, left, right):
    """Alignment and drift, beside their exact values."""
    step, along, velocity = np.loadtxt(folder / "drift.txt").T
    exact = 1 / np.tanh(2) - 1 / 2
    for axes, values, law, label in (
        (left, along, exact, "mean cosine of axis and field"),
        (right, velocity, 4.0 * exact / 2, "mean velocity along the field"),
    ):
        axes.plot(step * 0.02, values, lw=0.5)
        axes.axhline(law, color="C1")
        axes.set(xlabel="time", ylabel=label)
        print("swimmers: {}: {:.4f} ± {:.4f}".format(label, *mean(values[500:])), f"{law:.4f}")


def pour(folder, left, right):
    """The energy during pouring, and a side view at the end."""
    rows = thermo(folder)
    left.plot(rows["Step"] * 5e-4, rows["KinEng"])
    left.set(xlabel="time", ylabel="kinetic energy")
    for _, body, x, _, z in dump(folder / "end.dump"):
        right.add_patch(plt.Circle((x, z), 0.45, color=f"C{int(body) % 10}", ec="black", lw=0.2))
    right.set(xlabel="x", ylabel="z", xlim=(-0.5, 8.5), ylim=(0, 8), aspect="equal")


def grafted(folder, left, right):
    """The radius of gyration, and one particle at the end."""
    step, size = np.loadtxt(folder / "brush.txt").T
    left.plot(step * 5e-3, size)
    left.set(xlabel="time", ylabel="radius of gyration")
    print("grafted: {:.3f} ± {:.3f}".format(*mean(size)))
    atoms = dump(folder / "end.dump")[:168]
    atoms = atoms[np.argsort(atoms[:, 4])]
    colors = np.where(atoms[:, 1] > 0, "C1", "C0")
    right.scatter(*atoms[:, 2:4].T, s=30, c=colors, edgecolors="black", linewidths=0.3)
    right.set(xlabel="x", ylabel="y", aspect="equal")


def reaxff(folder, left, right):
    """g(r) of oxygen, and the energy of a molecule, with rigid and with flexible molecules."""
    for way, log, dt in ("rigid", "log.lammps", 8.0), ("flexible", "log.flexible", 0.5):
        r, g = np.loadtxt(folder / f"rdf.{way}.txt", skiprows=4, usecols=(1, 2)).T
        left.plot(r, g)
        rows = thermo(folder, log)
        step, energy = (rows[name][np.isfinite(rows["v_energy"])] for name in ("Step", "v_energy"))
        right.plot((step - step[0]) * dt / 1000, energy, label=f"{way}, {dt:g} fs")
    left.set(xlabel="r, Å", ylabel="g(r) of oxygen", xlim=(2, 6))
    right.legend()
    right.set(xlabel="time, ps", ylabel="U of a molecule, kcal/mol")


RECIPES = [
    *(solute, field, diffusion, peptide, nematic, shear),
    *(framework, gas, swimmers, pour, grafted, reaxff),
]


def main(folder, *names):
    for draw in RECIPES:
        name = draw.__name__
        if names and name not in names:
            continue
        if not (folder / name).exists():
            run(name, folder / name)
        figure, axes = plt.subplots(1, 2, figsize=(7.2, 2.8), layout="constrained")
        draw(folder / name, *axes)
        path = PAGES / f"{name}.png"
        figure.savefig(path, dpi=110)
        plt.close(figure)
        Image.open(path).convert("RGB").convert(
            "P", palette=Image.Palette.ADAPTIVE, colors=64
        ).save(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
