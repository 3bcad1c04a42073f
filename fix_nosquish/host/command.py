"""The words of the fix line, checked: GROUP BODYSTYLE [args] [keyword value ...]."""

import re
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

from ..errors import RunError
from . import rigid_fixes

STYLES = "single, molecule, custom i_NAME, custom v_NAME or group N ID1 ... IDN"
_FILE = "a file: its name, or v_NAME of a string-style variable"
# the most that a keyword may be, and why: each costs time in every step
_MOST = {
    "mrot": (1000, "rotor exact is what many inner steps come to, at the cost of one"),
    "tchain": (1000, "more than some ten thermostats in a chain change nothing"),
}
KEYWORDS = {
    "mrot": "the number of inner rotor steps, a whole number of at least 1",
    "order": "321 (the axis of the smallest moment turns outermost) or 123 (of the largest)",
    "rotor": "exact (the free rotation as it is) or split (into rotations about one axis each)",
    "force": "M xflag yflag zflag (bodies n, m*n or *, and three times on or off)",
    "torque": "M xflag yflag zflag (bodies n, m*n or *, and three times on or off)",
    "reinit": "yes or no",
    "infile": _FILE,
    "output": "N, a whole number of at least 1, and " + _FILE,
    "points": "the ID of a group, whose atoms are in no body",
    "mol": "the ID of a molecule template, as fix deposit, pour or gcmc names it",
    "gravity": "the ID of a fix gravity with its word disable, which gives the bodies' weight",
}
ROTORS = "exact", "split"
_NUMBER = "a number, or v_NAME of an equal-style variable"
THERMOSTATS = "langevin", "csvr", "nh"
TILTS = "xy", "xz", "yz"
PRESSURES = "iso", "aniso", "tri", "x", "y", "z", *TILTS
BAROSTATS = "crescale", "mtk"
COUPLES = "none", "xyz", "xy", "yz", "xz"
# keywords of a minimisation: tolerances, and those of min_modify
QUENCH = (
    *("force FTOL", "torque TTOL", "dmax", "tmax", "tmin", "dtgrow", "dtshrink"),
    *("alpha0", "alphashrink", "delaystep", "halfstepback"),
)
# keywords that only some integrators have; where one has other values, they stand behind it
OWN_KEYWORDS = {
    "temp": f"TSTART, TSTOP and TDAMP, each {_NUMBER}",
    "temp T": f"T, {_NUMBER}",
    "steps": "a whole number of at least 1",
    "mix": f"{_NUMBER}, above 0 and at most 1",
    **dict.fromkeys(QUENCH, _NUMBER),
    "delaystep": "a whole number of at least 1",
    "halfstepback": "yes or no",
    "thermostat": f"one of {', '.join(THERMOSTATS)}",
    "seed": "a whole number from 1 to 2147483647",
    "tchain": "the length of the chain, a whole number of at least 1",
    "separate": "yes or no",
    "moments": f"equal VALUE (mass times length squared) or scale FACTOR, {_NUMBER}, or step",
    **dict.fromkeys(PRESSURES, f"PSTART, PSTOP and PDAMP, each {_NUMBER}"),
    "couple": f"one of {', '.join(COUPLES)}",
    "barostat": f"one of {', '.join(BAROSTATS)}",
    "every": "a whole number of at least 1",
    "dilate": "the ID of a group, whose atoms, of those in no body, move with the box",
    "compressibility": _NUMBER,
}
# keywords of other fixes, and of other integrators, and what serves instead
_NPT_NPH = "fix nosquish/npt and fix nosquish/nph"
_ELSEWHERE = {
    "langevin": "fix nosquish/nvt has Langevin's thermostat: temp TSTART TSTOP TDAMP seed N",
    **dict.fromkeys(
        ("bodyforces", "energy", "virial", "respa", "dynamic/dof", "external"),
        "it is a word of fix_modify, behind this fix",
    ),
    "temp": "this integrator keeps no temperature, fix nosquish/nvt and fix nosquish/npt do",
    **dict.fromkeys(
        ("tchain", "thermostat", "separate"),
        "this integrator has no thermostat, fix nosquish/nvt and fix nosquish/npt have",
    ),
    "seed": "this integrator draws no random numbers, fix nosquish/nvt, fix nosquish/npt and fix "
    "nosquish/hmc do",
    **dict.fromkeys(("steps", "mix"), "this integrator tests no trajectory, fix nosquish/hmc does"),
    **dict.fromkeys(
        QUENCH[2:],
        "this integrator seeks no minimum, fix nosquish/fire does",
    ),
    "moments": "only averages over configurations do not depend on the moments, as of fix "
    "nosquish/nvt, fix nosquish/npt and fix nosquish/hmc",
    "ptemp": f"the piston of {_NPT_NPH} is made for the temperature of the bodies: leave it out",
    "mtk": "barostat mtk of fix nosquish/npt, and that of fix nosquish/nph, is the piston of "
    "Martyna, Tobias and Klein: leave it out",
    **dict.fromkeys(("nreset", "drag"), "no piston of this package has it: leave it out"),
    **dict.fromkeys(
        ("tparam", "tloop", "ploop"),
        "fix nosquish/nvt and fix nosquish/npt have thermostat nh with tchain N, and integrate "
        "the chains in one way",
    ),
    **dict.fromkeys(
        (*PRESSURES, "couple", "every", "dilate"),
        f"this integrator keeps the volume, {_NPT_NPH} change it",
    ),
    **dict.fromkeys(
        ("barostat", "compressibility"),
        "fix nosquish/npt has it: without a thermostat the barostat is always the piston",
    ),
    "pchain": "the chain of the piston of fix nosquish/npt has the length tchain",
    "fixedpoint": f"the box of {_NPT_NPH} changes about its centre: leave it out",
    "flip": f"a box of {_NPT_NPH} that is tilted far always gets other vectors: leave it out",
    **dict.fromkeys(
        ("scalexy", "scaleyz", "scalexz"),
        f"a tilt of {_NPT_NPH} that has no keyword of its own stretches with its edge: leave it "
        "out",
    ),
    "update": "dipoles turn with their bodies: leave it out",
}


class Line(NamedTuple):
    """A fix line as its user wrote it, native or in the quotes of fix python/move.

    Attributes:
        name: of the integrator: nosquish/nve, or NVE.
        text: the line from there on.
        words: the group's ID, the body style and all that follows.
        prefix: what stands before the text.
        before: how many of LAMMPS's arguments stand before the body style; None in quotes.
        replaces: the name of LAMMPS's rigid fix whose words these are, without /small and the like;
            None if they are ours.
    """

    name: str
    text: str
    words: tuple
    prefix: str = "fix_nosquish."
    before: int | None = None
    replaces: str | None = None

    @classmethod
    def quoted(cls, text):
        """The words of fix python/move from the class on: NVE water molecule ..."""
        name, *words = text.split()
        return cls(name, text, tuple(words))

    @classmethod
    def native(cls, fix_id, group, style, words):
        """LAMMPS's words: fix ID GROUP STYLE WORDS ..."""
        text = " ".join((style, *words))
        before, replaces = f"fix {fix_id} {group} ", rigid_fixes.plain(style)
        return cls(style, text, (group, *words), before, 3, replaces)

    def naming(self, text):
        """A message, whose integrators are fix nosquish/nve and its kin, as this line names them:
        LAMMPS's own fix python/move comes without these styles."""
        if self.before is not None:
            return text
        return re.sub(r"fix nosquish/(\w+)", lambda one: f"fix_nosquish.{one[1].upper()}", text)

    def wrong(self, what, word=None):
        """An error that shows the line.

        Args:
            what: the message.  word: which one of `words` is wrong, None for none of them.
        """
        said, argument = f'"{self.prefix}{self.text}"', None
        if word is not None and self.before is not None:
            argument = word - 1 + self.before
            said = f"word {argument + 2} of {said}"
        return RunError(f"{self.naming(what)} (in {said})", everywhere=True, argument=argument)


@dataclass(frozen=True)
class Command:
    """What one fix line asks for.

    Attributes:
        line: the `Line`.
        group: ID of the group whose atoms form bodies.
        style: single, molecule, custom or group, as in LAMMPS's fix rigid.
        arguments: those of the style: () or (i_NAME or v_NAME,) or the groups' IDs.
        mrot: inner rotor steps per time step (m_rot of eq. 2.53).
        order: 321 or 123, the order of the axes in a rotor step, outermost first, with
            I_1 >= I_2 >= I_3.
        rotor: exact or split, as asked for by this keyword or by mrot or order; None for neither.
        force, torque: what each of these keywords says, in their order: (first body, last body,
            (x, y, z)); bodies count from 1, 0 stands for the open end of a range, x y z are True
            for on.
        reinit: whether the bodies are made anew when a run starts.
        infile: the file with the bodies' properties, None for none.
        output: (N, file) for the table of bodies every N steps, None for none.
        points: ID of the group whose atoms move as points, each by itself; None for none.
        mol: ID of the molecule template of which fixes insert bodies, None for none.
        gravity: ID of the fix gravity that gives the bodies' weight, None for none.
        temp: (TSTART, TSTOP, TDAMP) or (T,), words for numbers, None for none.
        steps: those of a trajectory, None for none.  mix: a word for a number.
        thermostat: one of `THERMOSTATS`.  seed: None for none.  tchain: thermostats in a chain.
        separate: whether translation and rotation have a thermostat each.
        moments: ("equal", value), the principal moments that bodies get, or ("scale", factor) of
            those of their atoms, each a word for a number; ("alike", None) for those of atoms that
            weigh alike; ("step", None) for those that the time step needs; None for those of the
            atoms.
        quench: dictionary from keywords of a minimisation to words for numbers.
        pressure: dictionary from some of `PRESSURES` to (PSTART, PSTOP, PDAMP), words for numbers.
        couple: one of `COUPLES`.  barostat: one of `BAROSTATS`.
        every: steps between two changes of the box, None for a part of PDAMP.
        dilate: ID of the group of which atoms that are in no body move with the box; None for none
            such.
        compressibility: a word for a number, None for the default.
    """

    line: Line
    group: str
    style: str
    arguments: tuple = ()
    mrot: int = 1
    order: int = 321
    rotor: str | None = None
    force: tuple = ()
    torque: tuple = ()
    reinit: bool = True
    infile: str | None = None
    output: tuple | None = None
    points: str | None = None
    mol: str | None = None
    gravity: str | None = None
    temp: tuple | None = None
    steps: int | None = None
    mix: str = "1"
    thermostat: str = THERMOSTATS[0]
    seed: int | None = None
    tchain: int = 3
    separate: bool = False
    moments: tuple | None = None
    quench: dict = field(default_factory=dict)
    pressure: dict = field(default_factory=dict)
    couple: str = "none"
    barostat: str = BAROSTATS[0]
    every: int | None = None
    dilate: str | None = None
    compressibility: str | None = None

    @property
    def text(self):
        """The line from the integrator's name on."""
        return self.line.text

    def pressure_of(self, part):
        """The words (PSTART, PSTOP, PDAMP) for an axis or a tilt, x, y, z, xy, xz or yz; None if it
        does not change."""
        given = [self.pressure.get(part), self.pressure.get("tri")]
        if part not in TILTS:
            given += [self.pressure.get("iso"), self.pressure.get("aniso")]
        elif given[1]:
            given[1] = "0", "0", given[1][2]
        return next(filter(None, given), None)

    def refuse_unless_positive(self, name, value):
        """Raise an error for a number, of this name on the fix line, that is not above zero."""
        if not value > 0:
            raise self.wrong(f"{name} is {value:g}, and must be above zero")

    def wrong(self, what):
        """The error for words that cannot be for these bodies, or for this integrator."""
        return self.line.wrong(what)

    @classmethod
    def parse(cls, line, own=()):
        """Read a `Line`.

        Args:
            line: the line.  own: which of `OWN_KEYWORDS` the class has.
        Raises:
            RunError: naming the word, what was expected, and what to do.
        """
        words = _Words(line)
        group = words.take("the ID of a group and a body style (" + STYLES + ")")
        style, arguments = _body_style(words)
        entries = {entry.split()[0]: entry for entry in (*KEYWORDS, *own)}
        known = {keyword: (KEYWORDS | OWN_KEYWORDS)[entry] for keyword, entry in entries.items()}
        if line.replaces:
            of_rigid = rigid_fixes.keywords(line.replaces)
            entries |= {keyword: keyword for keyword in of_rigid}
            known |= of_rigid
        values = {}
        while words.left:
            _read_keyword(words, values, entries, known)
        split = [keyword for keyword in ("mrot", "order") if keyword in values]
        if split and values.setdefault("rotor", "split") == "exact":
            raise line.wrong(
                f"keyword {split[0]} says how the rotation is split, and rotor exact splits none: "
                "leave one of them out"
            )
        if line.replaces:
            rigid_fixes.give_meaning(values, known)
        # as in fix rigid: the file is the start, not the state of later runs
        if "infile" in values and values.setdefault("reinit", False):
            raise line.wrong(
                "keyword infile says how bodies begin, and they go on from run to run as they "
                "are: leave out reinit yes"
            )
        _check_thermostat(line, values, known)
        _check_trajectories(line, values, known)
        _check_quench(line, values, known)
        _check_pressure(line, values, known)
        return cls(line, group, style, arguments, **values)


def _body_style(words):
    """The body style, and its arguments.

    Raises:
        RunError: naming the word.
    """
    style = words.take("a body style (" + STYLES + ")")
    arguments = ()
    if style == "custom":
        arguments = (words.take("i_NAME or v_NAME"),)
        if arguments[0][:2] not in ("i_", "v_") or len(arguments[0]) < 3:
            raise words.wrong(
                f"'{arguments[0]}' was given where custom expects i_NAME (a whole number per "
                "atom, of fix property/atom) or v_NAME (an atom-style variable)"
            )
    elif style == "group":
        count = words.whole("the number of groups")
        arguments = tuple(words.take(f"the ID of group {k + 1} of {count}") for k in range(count))
        if len(set(arguments)) < count:
            raise words.wrong("one group is named twice: each is one body")
    elif style not in ("single", "molecule"):
        raise words.wrong(f"unknown body style '{style}': expected {STYLES}")
    return style, arguments


def _read_keyword(words, values, entries, known):
    """Read a keyword and what follows it into `values`.

    Args:
        entries, known: dictionaries from the class's keywords to their entry in the tables, and to
            what is expected behind them.
    Raises:
        RunError: naming the word.
    """
    keyword = words.take("a keyword")
    expected = known.get(keyword)
    if expected is None:
        raise words.wrong(
            f"unknown keyword '{keyword}': "
            + _ELSEWHERE.get(keyword, "expected " + ", ".join(known))
        )
    entry = entries[keyword]
    before = {*values, *values.get("pressure", ()), *values.get("quench", ())}
    if keyword in before and entry not in ("force", "torque"):
        raise words.wrong(f"keyword {keyword} stands twice")
    if entry in ("force", "torque"):
        bodies = words.bodies(expected)
        flags = tuple(words.choice(("off", "on"), expected) for _ in "xyz")
        values[keyword] = (*values.get(keyword, ()), (*bodies, flags))
    elif entry in QUENCH:
        values.setdefault("quench", {})[keyword] = _READ[entry](words, expected)
    elif keyword in PRESSURES:
        values.setdefault("pressure", {})[keyword] = words.numbers(3, expected)
    else:
        values[keyword] = _READ[entry](words, expected)


def _check_pressure(line, values, known):
    """Raise an error if the words of a barostat do not go together."""
    if "iso" not in known:
        return
    given = set(values.get("pressure", ()))
    if not given:
        raise line.wrong(
            "the pressure is missing: give iso, aniso, tri, or some of x, y, z, xy, xz, yz "
            + OWN_KEYWORDS["iso"]
        )
    if len(given & {"iso", "aniso", "tri"}) > (not given & set("xyz")) or (
        "tri" in given and given & set(TILTS)
    ):
        raise line.wrong(
            "of the keywords iso, aniso, tri and x, y, z only one kind can stand; "
            "tilts xy, xz, yz beside another kind than tri"
        )
    if {"xy", "yz"} <= given and "xz" not in given:
        raise line.wrong("where tilts xy and yz change, xz follows them: give xz, too")
    if "iso" in given and "couple" in values:
        raise line.wrong("keyword couple is for aniso and x, y, z: iso couples all axes")
    couple = values.get("couple", "none")
    if not (couple == "none" or given & {"aniso", "tri"} or given >= set(couple)):
        raise line.wrong(f"keyword couple {couple}: give each of these axes")
    if "compressibility" in values and values.get("barostat") == "mtk":
        raise line.wrong("keyword compressibility is of no use to this barostat: leave it out")


def _check_thermostat(line, values, known):
    """Raise an error if the words of a thermostat do not go together."""
    if "thermostat" not in known:
        return
    if "temp" not in values:
        raise line.wrong(f"keyword temp is missing: give it {OWN_KEYWORDS['temp']}")
    thermostat = values.get("thermostat", THERMOSTATS[0])
    chains = thermostat == "nh"
    rescales = "iso" in known and values.get("barostat", BAROSTATS[0]) == "crescale"
    draws = "barostat" if rescales else "" if chains else "thermostat"
    if draws and "seed" not in values:
        raise line.wrong(
            f"keyword seed is missing: this {draws} draws random numbers, so give it "
            + OWN_KEYWORDS["seed"]
        )
    for keyword, serves in ("seed", draws), ("tchain", chains):
        if keyword in values and not serves:
            raise line.wrong(f"keyword {keyword} is of no use to this thermostat: leave it out")
    if values.get("separate") and thermostat == "langevin":
        raise line.wrong(
            "keyword separate is for thermostats csvr and nh: "
            "langevin acts on each motion by itself"
        )


def _check_trajectories(line, values, known):
    """Raise an error if words that trajectories need are missing."""
    if "steps" in known:
        for keyword in "temp", "steps", "seed":
            if keyword not in values:
                raise line.wrong(f"keyword {keyword} is missing: give it {known[keyword]}")


def _check_quench(line, values, known):
    """Raise an error if a tolerance is missing; have moments that serve a quench."""
    if "dmax" in known:
        for keyword in "force", "torque":
            if keyword not in values.get("quench", ()):
                raise line.wrong(
                    f"keyword {keyword} is missing: give it the largest {keyword} on a body that "
                    f"may be left at the end, {_NUMBER}"
                )
        values["moments"] = "alike", None


class _Words:
    """The words of a fix line, taken one after the other."""

    def __init__(self, line):
        self.line, self.left = line, list(line.words)

    def wrong(self, what):
        """An error about the last word that was taken."""
        return self.line.wrong(what, len(self.line.words) - len(self.left) - 1)

    def take(self, expected):
        """The next word."""
        if not self.left:
            raise self.line.wrong(f"the fix line ends where {expected} is expected")
        return self.left.pop(0)

    def whole(self, expected, most=2**63, why=""):
        """The next word as a whole number of at least 1."""
        word = self.take(expected)
        if not word.isdigit() or not 1 <= int(word) < most:
            high = f", and at most {most - 1}" if word.isdigit() and int(word) >= most else ""
            raise self.wrong(
                f"'{word}' was given where {expected} is expected{high}{why * bool(high)}"
            )
        return int(word)

    def choice(self, allowed, expected):
        """Which of two words comes next, as a bool."""
        word = self.take(expected)
        if word not in allowed:
            raise self.wrong(
                f"'{word}' was given where {' or '.join(allowed)} is expected, of {expected}"
            )
        return word == allowed[1]

    def numbers(self, count, expected):
        """The next words, which are numbers or name variables."""
        return tuple(self.number(expected) for _ in range(count))

    def number(self, expected):
        """The next word, which is a number or names a variable."""
        word = self.take(expected)
        try:
            finite = word[:2] == "v_" or isfinite(float(word))
        except ValueError:
            finite = False
        if not finite:
            raise self.wrong(f"'{word}' was given where {expected} is expected")
        return word

    def one_of(self, allowed, expected):
        """The next word, one of several."""
        word = self.take(expected)
        if word not in allowed:
            raise self.wrong(f"'{word}' was given where {expected} is expected")
        return word

    def bodies(self, expected):
        """The next word as a range of numbers, (first, last), 0 for an open end."""
        word = self.take(expected)
        match = re.fullmatch(r"([1-9]\d*)|([1-9]\d*)?\*([1-9]\d*)?", word)
        if not match:
            raise self.wrong(f"'{word}' was given where {expected} is expected")
        one, low, high = (int(part or 0) for part in match.groups())
        return (one, one) if one else (low, high)


_READ = {  # what the words behind a keyword give
    **{
        keyword: lambda words, expected, most=most, why=why: words.whole(
            expected, most + 1, f": {why}"
        )
        for keyword, (most, why) in _MOST.items()
    },
    "order": lambda words, expected: (321, 123)[words.choice(("321", "123"), expected)],
    "rotor": lambda words, expected: words.one_of(ROTORS, expected),
    "reinit": lambda words, expected: words.choice(("no", "yes"), expected),
    "infile": _Words.take,
    "output": lambda words, expected: (words.whole(expected, 2**31), words.take(expected)),
    **dict.fromkeys(("points", "mol", "gravity", "dilate"), _Words.take),
    "temp": lambda words, expected: words.numbers(3, expected),
    "temp T": lambda words, expected: words.numbers(1, expected),
    "thermostat": lambda words, expected: words.one_of(THERMOSTATS, expected),
    **dict.fromkeys(
        ("seed", "every", "steps"),
        lambda words, expected: words.whole(expected, 2**31),
    ),
    "separate": lambda words, expected: words.choice(("no", "yes"), expected),
    "moments": lambda words, expected: (
        how := words.one_of(("equal", "scale", "step"), expected),
        None if how == "step" else words.number(expected),
    ),
    "langevin": lambda words, expected: (
        *words.numbers(3, expected),
        words.whole(expected, 2**31),
    ),
    "tparam": lambda words, expected: tuple(
        words.whole(expected, most + 1) for most in (_MOST["tchain"][0], 2**31, 2**31)
    ),
    "pchain": lambda words, expected: words.whole(expected),
    "couple": lambda words, expected: words.one_of(COUPLES, expected),
    "barostat": lambda words, expected: words.one_of(BAROSTATS, expected),
    **dict.fromkeys(("compressibility", "mix", *QUENCH), _Words.number),
    "delaystep": lambda words, expected: str(words.whole(expected)),
    "halfstepback": lambda words, expected: str(int(words.choice(("no", "yes"), expected))),
}
