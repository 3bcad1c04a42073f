"""Fix lines of the ensembles: thermostats, barostats, hybrid Monte Carlo."""

from support.systems import line_of_class

THERMOSTATS = {
    "langevin": "seed 771",
    "csvr": "seed 771 thermostat csvr",
    "nh": "thermostat nh",
    "separate": "seed 771 thermostat csvr separate yes",
    "chains": "thermostat nh separate yes tchain 5",
}


def fix_nvt(words, temperature="2 2 4e-3"):
    """The fix line; temperature: TSTART TSTOP TDAMP."""
    return f"fix 1 all nosquish/nvt molecule temp {temperature} {words}\n"


POINTS = "group loose molecule 1 2 3 4 5\ngroup stiff subtract all loose\n"


def fix_nvt_with_points(words, temperature="2 2 2e-1"):
    """The lines for bodies and, besides, the atoms of five molecules as points."""
    line = f"fix 1 stiff nosquish/nvt molecule temp {temperature} {words} flexible loose"
    return f"{POINTS}{line}\n"


NPT_THERMOSTATS = THERMOSTATS | {"chains": "seed 771 thermostat nh tchain 5"}  # the barostat draws
NPT_CELL = "iso 12e-2 12e-2 2e-1 every 5 compressibility 8"


def fix_npt(words, cell=NPT_CELL, temperature="2 2 2e-1"):
    """The fix line; temperature: TSTART TSTOP TDAMP."""
    return f"fix 1 all nosquish/npt molecule temp {temperature} {words} {cell}\n"


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
    """The fix line of a name in `MTK_WORDS`."""
    style = "nph molecule" if name == "NPH" else "npt molecule barostat mtk"
    return f"fix 1 all nosquish/{style} {MTK_WORDS[name]} {cell} {more}\n"


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


def fix_hmc(words, name=None, group="all"):
    """The lines of the fix, with variables that its words may name, or of a class of HMC's."""
    line = line_of_class(name) if name else "fix 1 {group} nosquish/hmc {words}"
    variables = "variable half equal 0.5\nvariable none equal 1e-300\n"
    return f"{variables}{line.format(group=group, words=f'molecule {words}')}\n"


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
