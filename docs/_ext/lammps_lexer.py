"""LAMMPS's input language, for Pygments."""

from typing import ClassVar

from pygments.lexer import RegexLexer, bygroups
from pygments.token import Comment, Keyword, Name, Number, String, Text


class LammpsLexer(RegexLexer):
    """Commands, variables, numbers, texts and comments."""

    name, aliases, filenames = "LAMMPS", ["lammps"], ["in.*"]
    tokens: ClassVar = {
        "root": [
            (r"(^[ \t]*)(\w+)(?=\s)", bygroups(Text, Keyword)),
            (r"#.*$", Comment),
            (r"\$\{\w+\}|\$\w|\$\(.*?\)", Name.Variable),
            (r"\"[^\"]*\"|'[^']*'", String),
            (r"(?<![\w.])[-+]?\d+(\.\d*)?(e[-+]?\d+)?(?![\w.])", Number),
            (r"[\w/.*-]+", Text),
            (r"\s+|.", Text),
        ]
    }
