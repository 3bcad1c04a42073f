"""The quoted words of the fix line, checked: GROUP BODYSTYLE [args] [keyword value ...]."""

from dataclasses import dataclass

from .errors import RunError

STYLES = "single, molecule, custom i_NAME, custom v_NAME or group N ID1 ... IDN"
KEYWORDS = {
    "mrot": "the number of inner rotor steps, a whole number of at least 1",
    "order": "321 (the axis of the smallest moment turns outermost) or 123 (of the largest)",
}


@dataclass(frozen=True)
class Command:
    """What one fix line asks for.

    Attributes:
        text: the words as they stand on the line.
        group: ID of the group whose atoms form bodies.
        style: single, molecule, custom or group, as in LAMMPS's fix rigid.
        arguments: those of the style: () or (i_NAME or v_NAME,) or the groups' IDs.
        mrot: inner rotor steps per time step (m_rot of eq. 2.53).
        order: 321 or 123, the order of the axes in a rotor step, outermost first, with I_1 >= I_2 >= I_3.
    """

    text: str
    group: str
    style: str
    arguments: tuple = ()
    mrot: int = 1
    order: int = 321

    @classmethod
    def parse(cls, text):
        """Read the words after the class.

        Raises:
            RunError: naming the word, what was expected, and what to do.
        """
        words = text.split()

        def wrong(what):
            return RunError(f'{what} (in "fix_nosquish.{text}")', everywhere=True)

        def take(expected):
            if not words:
                raise wrong(f"the fix line ends where {expected} is expected")
            return words.pop(0)

        def whole(word, what):
            if not word.isdigit() or int(word) < 1:
                raise wrong(f"'{word}' was given where {what} is expected")
            return int(word)

        take("a class")
        group = take("the ID of a group and a body style (" + STYLES + ")")
        style = take("a body style (" + STYLES + ")")
        arguments = ()
        if style == "custom":
            arguments = (take("i_NAME or v_NAME"),)
            if arguments[0][:2] not in ("i_", "v_") or len(arguments[0]) < 3:
                raise wrong(
                    f"'{arguments[0]}' was given where custom expects i_NAME (a whole number per atom, "
                    "of fix property/atom) or v_NAME (an atom-style variable)"
                )
        elif style == "group":
            count = whole(take("the number of groups"), "the number of groups")
            arguments = tuple(take(f"the ID of group {k + 1} of {count}") for k in range(count))
            if len(set(arguments)) < count:
                raise wrong("one group is named twice: each is one body")
        elif style not in ("single", "molecule"):
            raise wrong(f"unknown body style '{style}': expected {STYLES}")
        values = {}
        while words:
            keyword = words.pop(0)
            if keyword not in KEYWORDS:
                raise wrong(f"unknown keyword '{keyword}': expected " + " or ".join(KEYWORDS))
            if keyword in values:
                raise wrong(f"keyword {keyword} stands twice")
            word = take(KEYWORDS[keyword])
            values[keyword] = whole(word, KEYWORDS[keyword])
            if keyword == "order" and word not in ("321", "123"):
                raise wrong(f"'{word}' was given where {KEYWORDS[keyword]} is expected")
        return cls(text, group, style, arguments, **values)
