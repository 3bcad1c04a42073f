"""The words of the fix line, checked: GROUP BODYSTYLE [args] [keyword value ...]."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from types import MappingProxyType
from typing import Any, NamedTuple

from ..errors import RunError
from . import rigid_fixes


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
    words: tuple[str, ...]
    prefix: str = "fix_nosquish."
    before: int | None = None
    replaces: str | None = None

    @classmethod
    def quoted(cls, text: str, prefix: str = "fix_nosquish.") -> "Line":
        """The words of fix python/move from the class on: NVE water molecule ...

        Args:
            prefix: the class's module, with a point.
        """
        name, *words = text.split()
        return cls(name, text, tuple(words), prefix)

    @classmethod
    def native(cls, fix_id: str, group: str, style: str, words: Iterable[str]) -> "Line":
        """LAMMPS's words: fix ID GROUP STYLE WORDS ..."""
        text = " ".join((style, *words))
        before, replaces = f"fix {fix_id} {group} ", rigid_fixes.plain(style)
        return cls(style, text, (group, *words), before, 3, replaces)

    def naming(self, text: str) -> str:
        """A message, whose integrators are fix nosquish/nve and its kin, as this line names them:
        LAMMPS's own fix python/move comes without these styles."""
        if self.before is not None:
            return text
        return re.sub(r"fix nosquish/(\w+)", lambda one: f"fix_nosquish.{one[1].upper()}", text)

    def wrong(self, what: str, word: int | None = None) -> RunError:
        """An error that shows the line.

        Args:
            what: the message.  word: which one of `words` is wrong, None for none of them.
        """
        said, argument = f'"{self.prefix}{self.text}"', None
        if word is not None and self.before is not None:
            argument = word - 1 + self.before
            said = f"word {argument + 2} of {said}"
        return RunError(f"{self.naming(what)} (in {said})", everywhere=True, argument=argument)


_WHOLE = re.compile(r"0*[1-9]\d*")
_CUSTOM = re.compile(r"[iv]_.+")
_BODIES = re.compile(r"[1-9]\d*|([1-9]\d*)?\*([1-9]\d*)?")


class Switch(NamedTuple):
    """What keyword force or torque says of some bodies.

    Attributes:
        first, last: numbers of bodies, from 1 on; 0 for an open end.
        on: whether the components x, y and z act.
    """

    first: int
    last: int
    on: tuple[bool, ...]


class Output(NamedTuple):
    """Keyword output: the file, or v_NAME, that gets the table of bodies every so many steps."""

    steps: int
    file: str


class Moments(NamedTuple):
    """Keyword moments.

    Attributes:
        how: "equal": bodies get this principal moment; "scale": those of their atoms, times this;
            "step": those that the time step needs.
        word: a word for a number, "" for step.
    """

    how: str
    word: str = ""


def is_number(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return isfinite(float(word))
    except ValueError:
        return False


class _Words:
    """The words of a fix line, read one after the other.

    Methods that read take what is expected there, for the message, and raise a RunError.
    """

    def __init__(self, line: Line) -> None:
        self.line, self.left = line, list(line.words)

    def wrong(self, what: str) -> RunError:
        """An error about the last word that was taken."""
        return self.line.wrong(what, len(self.line.words) - len(self.left) - 1)

    def take(
        self, expected: str, fits: Callable[[str], object] = bool, but: str = "{} is expected"
    ) -> str:
        """The next word.

        Args:
            fits: whether a word can be the one.  but: what the message says of one that cannot.
        """
        if not self.left:
            raise self.line.wrong(f"the fix line ends where {expected} is expected")
        word = self.left.pop(0)
        if not fits(word):
            raise self.wrong(f"'{word}' was given where {but.format(expected)}")
        return word

    def one_of(self, expected: str, allowed: tuple[str, ...]) -> str:
        """The next word, one of several."""
        return self.take(expected, allowed.__contains__)

    def choice(self, expected: str, allowed: tuple[str, str] = ("no", "yes")) -> bool:
        """Which of two words comes next."""
        but = f"{' or '.join(allowed)} is expected, of {{}}"
        return self.take(expected, allowed.__contains__, but) == allowed[1]

    def whole(self, expected: str, most: int = 2**63 - 1, why: str = "") -> int:
        """The next word as a whole number from 1 to `most`. Args: why: of that limit."""
        number = int(self.take(expected, _WHOLE.fullmatch))
        if number > most:
            limit = f"and at most {most}{why}"
            raise self.wrong(f"'{number}' was given where {expected} is expected, {limit}")
        return number

    def number(self, expected: str) -> str:
        """The next word, which is a number or names a variable."""
        return self.take(expected, lambda word: word[:2] == "v_" or is_number(word))

    def numbers(self, expected: str, count: int = 3) -> tuple[str, ...]:
        """The next words, which are numbers or name variables; `expected` begins with what they
        are called, in capitals."""
        names = re.findall("[A-Z]+", expected)[:count]
        return tuple(self.number(f"{name} (of {expected})") for name in names)

    def switch(self, expected: str) -> Switch:
        """A range of bodies, and three times on or off."""
        low, star, high = self.take(expected, _BODIES.fullmatch).partition("*")
        on = tuple(self.choice(expected, ("off", "on")) for _ in "xyz")
        return Switch(int(low or 0), int((high if star else low) or 0), on)

    def moments(self, expected: str) -> Moments:
        """How the bodies' principal moments are chosen."""
        how = self.one_of(expected, ("equal", "scale", "step"))
        return Moments(how, "" if how == "step" else self.number(expected))


class Keyword(NamedTuple):
    """A keyword of the fix line.

    Attributes:
        expected: what is expected behind it, as messages say it.
        read: a function of the words and of `expected`, which gives the value.
        within: the dictionary of `Command` in which the value is, "" for a field of its own.
        repeats: whether it may stand several times; the field has a tuple of values then.
    """

    expected: str
    read: Callable[[_Words, str], Any]
    within: str = ""
    repeats: bool = False


STYLES = "single, molecule, custom i_NAME, custom v_NAME or group N ID1 ... IDN"
THERMOSTATS = "langevin", "csvr", "nh"
TILTS = "xy", "xz", "yz"
PRESSURES = "iso", "aniso", "tri", "x", "y", "z", *TILTS
BAROSTATS = "crescale", "mtk"
COUPLES = "none", "xyz", "xy", "yz", "xz"
_FILE = "a file: its name, or v_NAME of a string-style variable"
_NUMBER = "a number, or v_NAME of an equal-style variable"
_COUNT = "a whole number of at least 1"
_SWITCHES = Keyword(
    "M xflag yflag zflag (bodies n, m*n or *, and three times on or off)",
    _Words.switch,
    repeats=True,
)
_INTEGER, _LONGEST_CHAIN = 2**31 - 1, 1000
_YES_OR_NO = Keyword("yes or no", _Words.choice)
_integer = partial(_Words.whole, most=_INTEGER)


def _one_of(allowed: tuple[str, ...]) -> Keyword:
    """A keyword behind which one of these words stands."""
    return Keyword(f"one of {', '.join(allowed)}", partial(_Words.one_of, allowed=allowed))


KEYWORDS = {
    "mrot": Keyword(
        f"the number of inner rotor steps, {_COUNT}",
        partial(
            _Words.whole,
            most=1000,  # each costs time in every step
            why=": rotor exact is the limit of many inner steps, at the cost of one",
        ),
    ),
    "order": Keyword(
        "321 (the axis of the smallest moment turns outermost) or 123 (of the largest)",
        lambda words, expected: 123 if words.choice(expected, ("321", "123")) else 321,
    ),
    "rotor": Keyword(
        "exact (the free rotation as it is) or split (into rotations about one axis each)",
        partial(_Words.one_of, allowed=("exact", "split")),
    ),
    "force": _SWITCHES,
    "torque": _SWITCHES,
    "reinit": _YES_OR_NO,
    "details": _YES_OR_NO,
    "infile": Keyword(_FILE, _Words.take),
    "output": Keyword(
        f"N, {_COUNT}, and {_FILE}",
        lambda words, expected: Output(words.whole(expected, _INTEGER), words.take(expected)),
    ),
    "flexible": Keyword("the ID of a group, whose atoms are in no body", _Words.take),
    "mol": Keyword(
        "the ID of a molecule template, as fix deposit, pour or gcmc names it", _Words.take
    ),
    "gravity": Keyword(
        "the ID of a fix gravity with its word disable, which gives the bodies' weight",
        _Words.take,
    ),
}
# keywords that only some integrators have; where one has other values, they stand behind it
OWN_KEYWORDS = {
    "temp": Keyword(f"TSTART, TSTOP and TDAMP, each {_NUMBER}", _Words.numbers),
    "temp T": Keyword(f"T, {_NUMBER}", partial(_Words.numbers, count=1)),
    "steps": Keyword(_COUNT, _integer),
    "mix": Keyword(f"{_NUMBER}, above 0 and at most 1", _Words.number),
    "thermostat": _one_of(THERMOSTATS),
    "seed": Keyword("a whole number from 1 to 2147483647", _integer),
    "tchain": Keyword(
        f"the length of the chain, {_COUNT}",
        partial(
            _Words.whole,
            most=_LONGEST_CHAIN,  # each costs time in every step
            why=": more than some ten thermostats in a chain change nothing",
        ),
    ),
    "separate": _YES_OR_NO,
    "moments": Keyword(
        f"equal VALUE (mass times length squared) or scale FACTOR, {_NUMBER}, or step",
        _Words.moments,
    ),
    **dict.fromkeys(
        PRESSURES,
        Keyword(f"PSTART, PSTOP and PDAMP, each {_NUMBER}", _Words.numbers, "pressure"),
    ),
    "couple": _one_of(COUPLES),
    "barostat": _one_of(BAROSTATS),
    "every": Keyword(_COUNT, _integer),
    "dilate": Keyword(
        "the ID of a group, whose atoms, of those in no body, move with the box", _Words.take
    ),
    "compressibility": Keyword(_NUMBER, _Words.number),
}
# keywords of LAMMPS's rigid fixes: see `rigid_fixes.give_meaning`
OF_RIGID_FIXES = {
    "langevin": Keyword(
        f"TSTART, TSTOP, TDAMP and a seed: three numbers and {_COUNT}",
        lambda words, expected: (*words.numbers(expected), words.whole(expected, _INTEGER)),
    ),
    "tparam": Keyword(
        "the length of the chains, iterations and order, three whole numbers of at least 1",
        lambda words, expected: tuple(
            words.whole(expected, most) for most in (_LONGEST_CHAIN, _INTEGER, _INTEGER)
        ),
    ),
    "pchain": Keyword(f"the length of the barostat's chain, {_COUNT}", _Words.whole),
}
# keywords of other fixes, and of other integrators, and what serves instead
_NPT_NPH = "fix nosquish/npt and fix nosquish/nph"
_NPT_OR_NPH = _NPT_NPH.replace("and", "or")
_ELSEWHERE = {
    "langevin": "fix nosquish/nvt has Langevin's thermostat: temp TSTART TSTOP TDAMP seed N",
    **dict.fromkeys(
        ("bodyforces", "energy", "virial", "respa", "dynamic/dof", "external"),
        "give it by fix_modify, after this fix",
    ),
    **dict.fromkeys(
        ("temp", "tchain", "thermostat", "separate"),
        "this integrator has no thermostat: use fix nosquish/nvt or fix nosquish/npt",
    ),
    "seed": "this integrator uses no random numbers; fix nosquish/nvt, fix nosquish/npt and fix "
    "nosquish/hmc do",
    **dict.fromkeys(("steps", "mix"), "it is a keyword of fix nosquish/hmc"),
    "moments": "other moments change the dynamics: it is a keyword of fix nosquish/nvt, fix "
    "nosquish/npt and fix nosquish/hmc",
    "ptemp": f"the temperature of the bodies sets the mass of the piston of {_NPT_NPH}: leave it "
    "out",
    "mtk": "barostat mtk of fix nosquish/npt, and the barostat of fix nosquish/nph, is the one of "
    "Martyna, Tobias and Klein: leave it out",
    **dict.fromkeys(("nreset", "drag"), "the piston of this package has none: leave it out"),
    **dict.fromkeys(
        ("tparam", "tloop", "ploop"),
        "fix nosquish/nvt and fix nosquish/npt have thermostat nh with tchain N; the other "
        "parameters of the chains cannot be changed",
    ),
    **dict.fromkeys(
        (*PRESSURES, "couple", "every", "dilate"),
        f"this integrator has no barostat: use {_NPT_OR_NPH}",
    ),
    **dict.fromkeys(
        ("barostat", "compressibility"),
        "fix nosquish/npt has it: without a thermostat the barostat is always the piston",
    ),
    "pchain": "the chain of the piston of fix nosquish/npt has the length tchain",
    "points": "it is called flexible now: flexible GROUP",
    "fixedpoint": f"with {_NPT_NPH} the box changes about its centre: leave it out",
    "flip": f"with {_NPT_NPH} a box with a large tilt always flips: leave it out",
    **dict.fromkeys(
        ("scalexy", "scaleyz", "scalexz"),
        f"with {_NPT_NPH} a tilt without its own keyword scales with its edge: leave it out",
    ),
    "update": "dipoles rotate with their bodies: leave it out",
}


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
        force, torque: what each of these keywords says, in their order.
        reinit: whether the bodies are made anew when a run starts.
        details: whether the log says what a step does.
        infile: the file with the bodies' properties, None for none.
        output: the table of bodies, None for none.
        flexible: ID of the group whose atoms are in no body and move one by one; None for none.
        mol: ID of the molecule template of which fixes insert bodies, None for none.
        gravity: ID of the fix gravity that gives the bodies' weight, None for none.
        temp: (TSTART, TSTOP, TDAMP) or (T,), words for numbers, () for none.
        steps: those of a trajectory, 0 for none.  mix: a word for a number.
        thermostat: one of `THERMOSTATS`.  seed: None for none.  tchain: thermostats in a chain.
        separate: whether translation and rotation have a thermostat each.
        moments: the principal moments that bodies get, None for those of their atoms.
        pressure: dictionary from some of `PRESSURES` to (PSTART, PSTOP, PDAMP), words for numbers.
        couple: one of `COUPLES`.  barostat: one of `BAROSTATS`.
        every: steps between two changes of the box, None for a part of PDAMP.
        dilate: ID of the group of which atoms that are in no body move with the box; None for none
            such.
        compressibility: a word for a number, None for the default.
        own: dictionary from keywords of the class's own to words for numbers.
    """

    line: Line
    group: str
    style: str
    arguments: tuple[str, ...] = ()
    mrot: int = 1
    order: int = 321
    rotor: str | None = None
    force: tuple[Switch, ...] = ()
    torque: tuple[Switch, ...] = ()
    reinit: bool = True
    details: bool = False
    infile: str | None = None
    output: Output | None = None
    flexible: str | None = None
    mol: str | None = None
    gravity: str | None = None
    temp: tuple[str, ...] = ()
    steps: int = 0
    mix: str = "1"
    thermostat: str = THERMOSTATS[0]
    seed: int | None = None
    tchain: int = 3
    separate: bool = False
    moments: Moments | None = None
    pressure: dict[str, tuple[str, ...]] = field(default_factory=dict)
    couple: str = "none"
    barostat: str = BAROSTATS[0]
    every: int | None = None
    dilate: str | None = None
    compressibility: str | None = None
    own: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The line from the integrator's name on."""
        return self.line.text

    def pressure_of(self, part: str) -> tuple[str, ...] | None:
        """The words (PSTART, PSTOP, PDAMP) for an axis or a tilt, x, y, z, xy, xz or yz; None if it
        does not change."""
        given = self.pressure
        if part not in TILTS:
            return next(
                (given[word] for word in (part, "tri", "iso", "aniso") if word in given), None
            )
        tilted = ("0", "0", given["tri"][2]) if "tri" in given else None
        return given.get(part, tilted)

    def refuse_unless_positive(self, name: str, value: float) -> None:
        """Raise an error for a number, of this name on the fix line, that is not above zero."""
        if not value > 0:
            raise self.wrong(f"{name} is {value:g}, and must be above zero")

    def wrong(self, what: str) -> RunError:
        """The error for words that cannot be for these bodies, or for this integrator."""
        return self.line.wrong(what)

    @classmethod
    def parse(
        cls, line: Line, keywords: Iterable[str] = (), own: Mapping[str, str] = MappingProxyType({})
    ) -> "Command":
        """Read a `Line`.

        Args:
            line: the line.  keywords: which of `OWN_KEYWORDS` the class has.
            own: as `Integrator.extra_keywords`.
        Raises:
            RunError: naming the word, what was expected, and what to do.
        """
        words, entries = _Words(line), KEYWORDS | OWN_KEYWORDS
        group = words.take(f"the ID of a group and a body style ({STYLES})")
        style, arguments = _body_style(words)
        known = {entry.split()[0]: entries[entry] for entry in (*KEYWORDS, *keywords)}
        known |= {
            name: Keyword(f"{what}, {_NUMBER}", _Words.number, "own") for name, what in own.items()
        }
        if line.replaces:
            more = OWN_KEYWORDS | OF_RIGID_FIXES
            known |= {name: more[name] for name in rigid_fixes.KEYWORDS[line.replaces]}
        values: dict[str, Any] = {}
        while words.left:
            _read_keyword(words, values, known)
        splits = [name for name in ("mrot", "order") if name in values]
        if splits and values.setdefault("rotor", "split") == "exact":
            raise line.wrong(
                f"keyword {splits[0]} says how the rotation is split, and rotor exact splits none: "
                "leave one of them out"
            )
        if line.replaces:
            rigid_fixes.give_meaning(values, known, line.words)
        # as in fix rigid: the file is the start, not the state of later runs
        if "infile" in values and values.setdefault("reinit", False):
            raise line.wrong(
                "keyword infile says how bodies begin, and they go on from run to run as they "
                "are: leave out reinit yes"
            )
        if "thermostat" in known:
            _check_thermostat(line, values, "barostat" in known)
        given = values.keys() | values.get("own", {}).keys()
        needed = *(("temp", "steps", "seed") if "steps" in known else ()), *own
        _refuse_missing(line, given, {name: known[name].expected for name in needed})
        if "iso" in known:
            _check_pressure(line, values)
        return cls(line, group, style, arguments, **values)


def _body_style(words: _Words) -> tuple[str, tuple[str, ...]]:
    """The body style, and its arguments.

    Raises:
        RunError: naming the word.
    """
    style = words.take(f"a body style ({STYLES})")
    if style == "custom":
        but = (
            "custom expects i_NAME (a whole number per atom, of fix property/atom) or v_NAME (an "
            "atom-style variable)"
        )
        return style, (words.take("i_NAME or v_NAME", _CUSTOM.fullmatch, but),)
    if style == "group":
        count = words.whole("the number of groups")
        names = tuple(words.take(f"the ID of group {k + 1} of {count}") for k in range(count))
        if len(set(names)) < count:
            raise words.wrong("one group is named twice: each is one body")
        return style, names
    if style not in ("single", "molecule"):
        raise words.wrong(f"unknown body style '{style}': expected {STYLES}")
    return style, ()


def _read_keyword(words: _Words, values: dict[str, Any], known: dict[str, Keyword]) -> None:
    """Read a keyword and what follows it into `values`.

    Args:
        values: of the fields of `Command`, by name.  known: the keywords that the class has.
    Raises:
        RunError: naming the word.
    """
    name = words.take("a keyword")
    if name not in known:
        instead = _ELSEWHERE.get(name, f"expected {', '.join(known)}")
        raise words.wrong(f"unknown keyword '{name}': {instead}")
    keyword = known[name]
    place = values.setdefault(keyword.within, {}) if keyword.within else values
    if name in place and not keyword.repeats:
        raise words.wrong(f"keyword {name} is given twice")
    value = keyword.read(words, keyword.expected)
    place[name] = (*place.get(name, ()), value) if keyword.repeats else value


def _refuse(line: Line, *problems: tuple[object, str]) -> None:
    """Raise an error with the message of the first of these problems that there is."""
    for there, message in problems:
        if there:
            raise line.wrong(message)


def _refuse_missing(line: Line, given: Collection[str], expected: Mapping[str, str]) -> None:
    """Raise an error that names all keywords which are missing.

    Args:
        expected: dictionary from keywords to what stands behind them.
    """
    *others, last = missing = [name for name in expected if name not in given] or [""]
    if others:
        texts = " and ".join(f"{name} ({expected[name]})" for name in missing)
        raise line.wrong(f"keywords {', '.join(others)} and {last} are missing: give {texts}")
    if last:
        raise line.wrong(f"keyword {last} is missing: give it {expected[last]}")


def _check_pressure(line: Line, values: dict[str, Any]) -> None:
    """Raise an error if the words of a barostat do not go together."""
    given, couple = set(values.get("pressure", ())), values.get("couple", "none")
    # in fix rigid an axis behind aniso has words of its own
    wholes = given & ({"iso", "tri"} if line.replaces else {"iso", "aniso", "tri"})
    several = len(wholes) > (not given & set("xyz"))
    _refuse(
        line,
        (
            not given,
            "the pressure is missing: give iso, aniso, tri, or some of x, y, z, xy, xz, yz "
            + OWN_KEYWORDS["iso"].expected,
        ),
        (
            several or ("tri" in given and given & set(TILTS)),
            "use only one of iso, aniso, tri and the axes x, y, z; tri cannot be combined with "
            "xy, xz and yz",
        ),
        (
            {"xy", "yz"} <= given and "xz" not in given,
            "if tilts xy and yz change, xz must change, too: give xz",
        ),
        (
            "iso" in given and "couple" in values,
            "keyword couple is for aniso and x, y, z: iso couples all axes",
        ),
        (
            not (couple == "none" or given & {"aniso", "tri"} or given >= set(couple)),
            f"keyword couple {couple}: give each of these axes",
        ),
        (
            "compressibility" in values and values.get("barostat") == "mtk",
            "keyword compressibility has no effect with this barostat: leave it out",
        ),
    )


def _check_thermostat(line: Line, values: dict[str, Any], has_barostat: bool) -> None:
    """Raise an error if the words of a thermostat do not go together."""
    thermostat = values.get("thermostat", THERMOSTATS[0])
    chains = thermostat == "nh"
    rescales = has_barostat and values.get("barostat", BAROSTATS[0]) == "crescale"
    draws = "barostat" if rescales else "" if chains else "thermostat"
    no_use = "keyword {} has no effect with this thermostat: leave it out"
    expected = {name: OWN_KEYWORDS[name].expected for name in ("temp", "seed")[: 1 + bool(draws)]}
    if draws:
        expected["seed"] += f", because this {draws} draws random numbers"
    _refuse_missing(line, values, expected)
    _refuse(
        line,
        ("seed" in values and not draws, no_use.format("seed")),
        ("tchain" in values and not chains, no_use.format("tchain")),
        (
            values.get("separate") and thermostat == "langevin",
            "keyword separate is for thermostats csvr and nh: "
            "langevin acts on each motion by itself",
        ),
    )
