"""Fix lines of the ensembles: thermostats, barostats, hybrid Monte Carlo."""

THERMOSTATS = {
    "langevin": "seed 771",
    "csvr": "seed 771 thermostat csvr",
    "nh": "thermostat nh",
    "separate": "seed 771 thermostat csvr separate yes",
    "chains": "thermostat nh separate yes tchain 5",
}


def fix_nvt(words, temperature="2 2 4e-3", group="all"):
    """The fix line, with a temperature, its goal and the damping time."""
    return f'fix 1 {group} python/move "fix_nosquish.NVT all molecule temp {temperature} {words}"\n'


POINTS = "group loose molecule 1 2 3 4 5\ngroup stiff subtract all loose\n"


def fix_nvt_with_points(words, temperature="2 2 2e-1"):
    """The lines for bodies and, besides, the atoms of five molecules as points."""
    line = f"NVT stiff molecule temp {temperature} {words} flexible loose"
    return f'{POINTS}fix 1 all python/move "fix_nosquish.{line}"\n'


NPT_THERMOSTATS = THERMOSTATS | {"chains": "seed 771 thermostat nh tchain 5"}  # the barostat draws
NPT_CELL = "iso 12e-2 12e-2 2e-1 every 5 compressibility 8"


def fix_npt(words, cell=NPT_CELL, temperature="2 2 2e-1"):
    """The fix line."""
    line = f"NPT all molecule temp {temperature} {words} {cell}"
    return f'fix 1 all python/move "fix_nosquish.{line}"\n'


MTK_WORDS = {
    "NPH": "",
    "langevin": "temp 2 2 2e-1 seed 771",
    "csvr": "temp 2 2 2e-1 thermostat csvr seed 771",
    "fast csvr": "temp 2 2 1e-2 thermostat csvr seed 771",
    "separate csvr": "temp 2 2 2e-1 thermostat csvr seed 771 separate yes",
    "nh": "temp 2 2 2e-1 thermostat nh",
    "separate": "temp 2 2 2e-1 thermostat nh separate yes",
}
MTK_CELL = "iso 12e-2 12e-2 4e-1 every 5"


def fix_mtk(name, cell=MTK_CELL, more=""):
    """The fix line."""
    words = "NPH all molecule" if name == "NPH" else "NPT all molecule barostat mtk"
    line = f"{words} {MTK_WORDS[name]} {cell} {more}"
    return f'fix 1 all python/move "fix_nosquish.{line}"\n'


TRI_CELL = "tri 12e-2 12e-2 2e-1 every 5"
TRI_FIXES = {
    "NPH": fix_mtk("NPH", TRI_CELL),
    "mtk langevin": fix_mtk("langevin", TRI_CELL),
    "mtk csvr": fix_mtk("csvr", TRI_CELL),
    "mtk nh": fix_mtk("nh", TRI_CELL),
    "crescale langevin": fix_npt("seed 771", f"{TRI_CELL} compressibility 8"),
    "crescale csvr": fix_npt("seed 771 thermostat csvr", f"{TRI_CELL} compressibility 8"),
    "crescale nh": fix_npt("seed 771 thermostat nh", f"{TRI_CELL} compressibility 8"),
}


def fix_hmc(words, name="fix_nosquish.HMC", group="all"):
    """The lines of the fix, with variables that its words may name."""
    variables = "variable half equal 0.5\nvariable none equal 1e-300\n"
    return f'{variables}fix 1 all python/move "{name} {group} molecule {words}"\n'


CHOSEN = {"equal": "moments equal 3", "scale": "moments scale v_four", "step": "moments step"}


def fix_moments(*words):
    """As of NVT, with the variable that `CHOSEN` names."""
    return "variable four equal 4\n" + fix_nvt(*words)


BOX = "iso 1.5 1.5 2.5 every 5"
STYLES = {
    "nve": "",
    "nvt": "temp 1.25 1.5 0.75 seed 4928",
    "npt": f"temp 1.25 1.5 0.75 seed 4928 {BOX} compressibility 0.01",
    "nph": BOX,
    "hmc": "temp 1.25 steps 5 seed 4928",
}
