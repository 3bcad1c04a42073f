"""Parsing and checks of the fix line: GROUP BODYSTYLE [args] [keyword value ...]."""

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
    """A fix line as the user wrote it, as a fix style or in the quotes of fix python/move.

    Attributes:
        name: name of the integrator: nosquish/nve, or NVE.
        text: the line from this name on.
        words: the group ID, the body style and everything after it.
        prefix: the text before `text`.
        before: number of LAMMPS's arguments before the body style; None in quotes.
        replaces: name of LAMMPS's rigid fix whose arguments these are, without /small and other
            suffixes; None for this package's own arguments.
    """

    name: str
    text: str
    words: tuple[str, ...]
    prefix: str = "fix_nosquish."
    before: int | None = None
    replaces: str | None = None

    @classmethod
    def quoted(cls, text: str, prefix: str = "fix_nosquish.") -> "Line":
        """Parse the quoted text of fix python/move from the class on: NVE water molecule ...

        Args:
            prefix: module of the class, with a trailing dot.
        """
        name, *words = text.split()
        return cls(name, text, tuple(words), prefix)

    @classmethod
    def native(cls, fix_id: str, group: str, style: str, words: Iterable[str]) -> "Line":
        """Parse the arguments of a fix style: fix ID GROUP STYLE WORDS ..."""
        text = " ".join((style, *words))
        before, replaces = f"fix {fix_id} {group} ", rigid_fixes.plain(style)
        return cls(style, text, (group, *words), before, 3, replaces)

    def naming(self, text: str) -> str:
        """Adapt a message that names fix nosquish/nve and the like to this line: LAMMPS's own fix
        python/move comes without these styles."""
        if self.before is not None:
            return text
        return re.sub(r"fix nosquish/(\w+)", lambda style: f"fix_nosquish.{style[1].upper()}", text)

    def wrong(self, what: str, word: int | None = None) -> RunError:
        """An error that shows the line.

        Args:
            what: the message.  word: index of the wrong one of `words`, None for none of them.
        """
        line, argument = f'"{self.prefix}{self.text}"', None
        if word is not None and self.before is not None:
            argument = word - 1 + self.before
            line = f"word {argument + 2} of {line}"
        return RunError(f"{self.naming(what)} (in {line})", everywhere=True, argument=argument)


_WHOLE = re.compile(r"0*[1-9]\d*")
_CUSTOM = re.compile(r"[iv]_.+")
_BODIES = re.compile(r"[1-9]\d*|([1-9]\d*)?\*([1-9]\d*)?")


class Switch(NamedTuple):
    """Argument of keyword force or torque for a range of bodies.

    Attributes:
        first, last: numbers of the bodies, from 1; 0 for an open end.
        on: whether the components x, y and z are active.
    """

    first: int
    last: int
    on: tuple[bool, ...]


class Output(NamedTuple):
    """Argument of keyword output: file, or v_NAME, for the table of bodies, and its interval in
    steps."""

    steps: int
    file: str


class Moments(NamedTuple):
    """Argument of keyword moments.

    Attributes:
        how: "equal": this principal moment for all axes; "scale": the moments of the atoms, times
            this factor; "step": moments that the time step needs.
        word: the number as a word, "" for step.
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

    Reading methods take a description of what is expected, for the message of the RunError that
    they raise.
    """

    def __init__(self, line: Line) -> None:
        self.line, self.left = line, list(line.words)

    def wrong(self, what: str) -> RunError:
        """An error about the last word that was read."""
        return self.line.wrong(what, len(self.line.words) - len(self.left) - 1)

    def take(
        self, expected: str, fits: Callable[[str], object] = bool, but: str = "{} is expected"
    ) -> str:
        """Read the next word.

        Args:
            fits: whether a word is acceptable.  but: format of the message for a word that is not.
        """
        if not self.left:
            raise self.line.wrong(f"the fix line ends where {expected} is expected")
        word = self.left.pop(0)
        if not fits(word):
            raise self.wrong(f"'{word}' was given where {but.format(expected)}")
        return word

    def one_of(self, expected: str, allowed: tuple[str, ...]) -> str:
        """Read the next word, which must be one of several."""
        return self.take(expected, allowed.__contains__)

    def choice(self, expected: str, allowed: tuple[str, str] = ("no", "yes")) -> bool:
        """Read one of two words; return whether it is the second one."""
        but = f"{' or '.join(allowed)} is expected, of {{}}"
        return self.take(expected, allowed.__contains__, but) == allowed[1]

    def whole(self, expected: str, most: int = 2**63 - 1, why: str = "") -> int:
        """Read a whole number from 1 to `most`. Args: why: the reason for that limit."""
        number = int(self.take(expected, _WHOLE.fullmatch))
        if number > most:
            limit = f"and at most {most}{why}"
            raise self.wrong(f"'{number}' was given where {expected} is expected, {limit}")
        return number

    def number(self, expected: str) -> str:
        """Read a word that is a number or the name of a variable."""
        return self.take(expected, lambda word: word[:2] == "v_" or is_number(word))

    def numbers(self, expected: str, count: int = 3) -> tuple[str, ...]:
        """Read words that are numbers or names of variables; `expected` begins with their names, in
        capitals."""
        names = re.findall("[A-Z]+", expected)[:count]
        return tuple(self.number(f"{name} (of {expected})") for name in names)

    def switch(self, expected: str) -> Switch:
        """Read a range of bodies, then on or off three times."""
        low, star, high = self.take(expected, _BODIES.fullmatch).partition("*")
        on = tuple(self.choice(expected, ("off", "on")) for _ in "xyz")
        return Switch(int(low or 0), int((high if star else low) or 0), on)

    def moments(self, expected: str) -> Moments:
        """Read the choice of the bodies' principal moments."""
        how = self.one_of(expected, ("equal", "scale", "step"))
        return Moments(how, "" if how == "step" else self.number(expected))


class Keyword(NamedTuple):
    """A keyword of the fix line.

    Attributes:
        expected: what must follow it, as messages say it.
        read: function of the words and of `expected` that returns the value.
        within: dictionary of `Command` that holds the value, "" for a separate field.
        repeats: whether it may be given several times; the field is then a tuple of values.
        instead: for an integrator that does not have it, what to use instead.
    """

    expected: str
    read: Callable[[_Words, str], Any]
    within: str = ""
    repeats: bool = False
    instead: str = ""


STYLES = "single, molecule, custom i_NAME, custom v_NAME or group N ID1 ... IDN"
TILTS = "xy", "xz", "yz"
PRESSURES = "iso", "aniso", "tri", "x", "y", "z", *TILTS
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
_integer = partial(_Words.whole, most=_INTEGER)


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
    "reinit": Keyword("yes or no", _Words.choice),
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
_NPT_NPH = "fix nosquish/npt and fix nosquish/nph"
_OF_THERMOSTATS = "this integrator has no thermostat: use fix nosquish/nvt or fix nosquish/npt"
_OF_BAROSTATS = f"this integrator has no barostat: use {_NPT_NPH.replace('and', 'or')}"
_OF_HMC = "it is a keyword of fix nosquish/hmc"
_OF_NPT = "fix nosquish/npt has it: without a thermostat the barostat is always the piston"
# keywords that only some integrators have; after a space: the form for other arguments
OWN_KEYWORDS = {
    "temp": Keyword(
        f"TSTART, TSTOP and TDAMP, each {_NUMBER}", _Words.numbers, instead=_OF_THERMOSTATS
    ),
    "temp T": Keyword(f"T, {_NUMBER}", partial(_Words.numbers, count=1)),
    "steps": Keyword(_COUNT, _integer, instead=_OF_HMC),
    "mix": Keyword(f"{_NUMBER}, above 0 and at most 1", _Words.number, instead=_OF_HMC),
    "thermostat": Keyword("the name of a thermostat", _Words.take, instead=_OF_THERMOSTATS),
    "seed": Keyword(
        "a whole number from 1 to 2147483647",
        _integer,
        instead="this integrator uses no random numbers; fix nosquish/nvt, fix nosquish/npt and "
        "fix nosquish/hmc do",
    ),
    "tchain": Keyword(
        f"the length of the chain, {_COUNT}",
        partial(
            _Words.whole,
            most=_LONGEST_CHAIN,  # each costs time in every step
            why=": more than some ten thermostats in a chain change nothing",
        ),
        instead=_OF_THERMOSTATS,
    ),
    "separate": Keyword("yes or no", _Words.choice, instead=_OF_THERMOSTATS),
    "moments": Keyword(
        f"equal VALUE (mass times length squared) or scale FACTOR, {_NUMBER}, or step",
        _Words.moments,
        instead="other moments change the dynamics: it is a keyword of fix nosquish/nvt, fix "
        "nosquish/npt and fix nosquish/hmc",
    ),
    **dict.fromkeys(
        PRESSURES,
        Keyword(
            f"PSTART, PSTOP and PDAMP, each {_NUMBER}",
            _Words.numbers,
            "pressure",
            instead=_OF_BAROSTATS,
        ),
    ),
    "couple": Keyword(
        f"one of {', '.join(COUPLES)}",
        partial(_Words.one_of, allowed=COUPLES),
        instead=_OF_BAROSTATS,
    ),
    "barostat": Keyword("the name of a barostat", _Words.take, instead=_OF_NPT),
    "every": Keyword(_COUNT, _integer, instead=_OF_BAROSTATS),
    "dilate": Keyword(
        "the ID of a group, whose atoms, of those in no body, move with the box",
        _Words.take,
        instead=_OF_BAROSTATS,
    ),
    "compressibility": Keyword(_NUMBER, _Words.number, instead=_OF_NPT),
}
_OF_CHAINS = (
    "fix nosquish/nvt and fix nosquish/npt have thermostat nh with tchain N; the other parameters "
    "of the chains cannot be changed"
)
# keywords of LAMMPS's rigid fixes: see `rigid_fixes.give_meaning`
OF_RIGID_FIXES = {
    "langevin": Keyword(
        f"TSTART, TSTOP, TDAMP and a seed: three numbers and {_COUNT}",
        lambda words, expected: (*words.numbers(expected), words.whole(expected, _INTEGER)),
        instead="fix nosquish/nvt has Langevin's thermostat: temp TSTART TSTOP TDAMP seed N",
    ),
    "tparam": Keyword(
        "the length of the chains, iterations and order, three whole numbers of at least 1",
        lambda words, expected: tuple(
            words.whole(expected, most) for most in (_LONGEST_CHAIN, _INTEGER, _INTEGER)
        ),
        instead=_OF_CHAINS,
    ),
    "pchain": Keyword(
        f"the length of the barostat's chain, {_COUNT}",
        _Words.whole,
        instead="the chain of the piston of fix nosquish/npt has the length tchain",
    ),
}
# keywords of other fixes, and what to use instead
_ELSEWHERE = {
    **dict.fromkeys(
        ("bodyforces", "energy", "virial", "respa", "dynamic/dof", "external"),
        "give it by fix_modify, after this fix",
    ),
    "ptemp": f"the temperature of the bodies sets the mass of the piston of {_NPT_NPH}: leave it "
    "out",
    "mtk": "barostat mtk of fix nosquish/npt, and the barostat of fix nosquish/nph, is the one of "
    "Martyna, Tobias and Klein: leave it out",
    **dict.fromkeys(("nreset", "drag"), "the piston of this package has none: leave it out"),
    **dict.fromkeys(("tloop", "ploop"), _OF_CHAINS),
    "points": "it is called flexible now: flexible GROUP",
    "details": "it was removed: the log says how bodies rotate, and how often the box changes",
    "fixedpoint": f"with {_NPT_NPH} the box changes about its centre: leave it out",
    "flip": f"with {_NPT_NPH} a box with a large tilt always flips: leave it out",
    **dict.fromkeys(
        ("scalexy", "scaleyz", "scalexz"),
        f"with {_NPT_NPH} a tilt without its own keyword scales with its edge: leave it out",
    ),
    "update": "dipoles rotate with their bodies: leave it out",
    **{name: keyword.instead for name, keyword in (OWN_KEYWORDS | OF_RIGID_FIXES).items()},
}


@dataclass(frozen=True)
class Command:
    """The settings of one fix line.

    Attributes:
        line: the `Line`.
        group: ID of the group whose atoms form bodies.
        style: single, molecule, custom or group, as in LAMMPS's fix rigid.
        arguments: arguments of the style: () or (i_NAME or v_NAME,) or IDs of groups.
        mrot: inner rotor steps per time step (m_rot of eq. 2.53).
        order: 321 or 123, the order of the axes in a rotor step, outermost first, with
            I_1 >= I_2 >= I_3.
        rotor: exact or split, as requested by this keyword or by mrot or order; None for neither.
        force, torque: `Switch`es of each of these keywords, in their order.
        reinit: whether the bodies are set up anew at the start of each run.
        infile: file with properties of the bodies, or None.
        output: the table of bodies, or None.
        flexible: ID of the group whose atoms are in no body and move individually, or None.
        mol: ID of the molecule template of bodies that other fixes insert, or None.
        gravity: ID of the fix gravity that gives the weight of the bodies, or None.
        temp: (TSTART, TSTOP, TDAMP) or (T,), numbers as words, or ().
        steps: length of a trajectory, 0 for none.  mix: a number as a word.
        thermostat, barostat: names, None for the integrator's first one.
        seed: or None.  tchain: length of the thermostat chain, or None.
        separate: whether translation and rotation have separate thermostats.
        moments: choice of the principal moments, None for those of the atoms.
        pressure: dictionary from some of `PRESSURES` to (PSTART, PSTOP, PDAMP), numbers as words.
        couple: one of `COUPLES`.
        every: steps between two changes of the box, None for a fraction of PDAMP.
        dilate: ID of the group whose atoms, of those in no body, move with the box, or None.
        compressibility: a number as a word, None for the default.
        extra: dictionary from additional keywords of the class to numbers as words.
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
    infile: str | None = None
    output: Output | None = None
    flexible: str | None = None
    mol: str | None = None
    gravity: str | None = None
    temp: tuple[str, ...] = ()
    steps: int = 0
    mix: str = "1"
    thermostat: str | None = None
    seed: int | None = None
    tchain: int | None = None
    separate: bool = False
    moments: Moments | None = None
    pressure: dict[str, tuple[str, ...]] = field(default_factory=dict)
    couple: str = "none"
    barostat: str | None = None
    every: int | None = None
    dilate: str | None = None
    compressibility: str | None = None
    extra: dict[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The line from the name of the integrator on."""
        return self.line.text

    def pressure_of(self, part: str) -> tuple[str, ...] | None:
        """(PSTART, PSTOP, PDAMP), as words, for an axis or a tilt (x, y, z, xy, xz or yz); None if
        it does not change."""
        given = self.pressure
        if part not in TILTS:
            return next(
                (given[word] for word in (part, "tri", "iso", "aniso") if word in given), None
            )
        tilted = ("0", "0", given["tri"][2]) if "tri" in given else None
        return given.get(part, tilted)

    def refuse_unless_positive(self, name: str, value: float) -> None:
        """Raise an error unless a number, of this name on the fix line, is above zero."""
        if not value > 0:
            raise self.wrong(f"{name} is {value:g}, and must be above zero")

    def refuse_missing(self, *entries: str, **reasons: str) -> None:
        """Raise an error that names those of these keywords, in `OWN_KEYWORDS`, that are missing.

        Args:
            reasons: by keyword, why it is needed.
        """
        names = {entry.split()[0]: OWN_KEYWORDS[entry].expected for entry in entries}
        expected = {name: text + reasons.get(name, "") for name, text in names.items()}
        _refuse_missing(self.line, [name for name in names if getattr(self, name)], expected)

    def wrong(self, what: str) -> RunError:
        """An error about arguments that these bodies or this integrator cannot have."""
        return self.line.wrong(what)

    @classmethod
    def parse(
        cls,
        line: Line,
        keywords: Iterable[str] = (),
        extra: Mapping[str, str] = MappingProxyType({}),
    ) -> "Command":
        """Parse a `Line`.

        Args:
            line: the line.  keywords: which of `OWN_KEYWORDS` the class has.
            extra: as `Integrator.extra_keywords`.
        Raises:
            RunError: naming the word, what was expected, and what to do.
        """
        words, entries = _Words(line), KEYWORDS | OWN_KEYWORDS | OF_RIGID_FIXES
        group = words.take(f"the ID of a group and a body style ({STYLES})")
        style, arguments = _body_style(words)
        known = {entry.split()[0]: entries[entry] for entry in (*KEYWORDS, *keywords)}
        known |= {
            name: Keyword(f"{what}, {_NUMBER}", _Words.number, "extra")
            for name, what in extra.items()
        }
        if line.replaces:
            known |= {name: entries[name] for name in rigid_fixes.KEYWORDS[line.replaces]}
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
        _refuse_missing(
            line, values.get("extra", {}), {name: known[name].expected for name in extra}
        )
        if "iso" in known:
            _check_pressure(line, values)
        return cls(line, group, style, arguments, **values)


def _body_style(words: _Words) -> tuple[str, tuple[str, ...]]:
    """The body style and its arguments.

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
    """Read a keyword and its arguments into `values`.

    Args:
        values: values by field of `Command`.  known: the keywords that the class has.
    Raises:
        RunError: naming the word.
    """
    name = words.take("a keyword")
    if name not in known:
        instead = _ELSEWHERE.get(name) or f"expected {', '.join(known)}"
        raise words.wrong(f"unknown keyword '{name}': {instead}")
    keyword = known[name]
    place = values.setdefault(keyword.within, {}) if keyword.within else values
    if name in place and not keyword.repeats:
        raise words.wrong(f"keyword {name} is given twice")
    value = keyword.read(words, keyword.expected)
    place[name] = (*place.get(name, ()), value) if keyword.repeats else value


def _refuse(line: Line, *problems: tuple[object, str]) -> None:
    """Raise an error with the message of the first problem that is true."""
    for problem, message in problems:
        if problem:
            raise line.wrong(message)


def _refuse_missing(line: Line, given: Collection[str], expected: Mapping[str, str]) -> None:
    """Raise an error that names all missing keywords.

    Args:
        expected: dictionary from keywords to what must follow them.
    """
    *others, last = missing = [name for name in expected if name not in given] or [""]
    if others:
        texts = " and ".join(f"{name} ({expected[name]})" for name in missing)
        raise line.wrong(f"keywords {', '.join(others)} and {last} are missing: give {texts}")
    if last:
        raise line.wrong(f"keyword {last} is missing: give it {expected[last]}")


def _check_pressure(line: Line, values: dict[str, Any]) -> None:
    """Raise an error if the arguments of a barostat contradict each other."""
    given, couple = set(values.get("pressure", ())), values.get("couple", "none")
    # in fix rigid an axis after aniso has its own arguments
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
    )
