"""The bitcode of the package's loops, which its build makes, so that a first use needs no numba.

It is for all processors of one kind and for all versions of Python.  It counts only for the sources
that it was made of, and for the version of LLVM that made it.
"""

import importlib.util
import pickle
from pathlib import Path

FOLDER = Path(__file__).parent.parent
FILE = FOLDER / "loops.bitcode"


def kept():
    """The bitcode that came with the package, by its modules' names; empty if it does not count."""
    try:
        made_of, codes = pickle.loads(FILE.read_bytes())
    except (OSError, ValueError, EOFError, pickle.UnpicklingError):
        return {}
    return codes if made_of == _made_of() else {}


def keep(codes, place):
    """Write the bitcode of all loops of the package, by its modules' names, to a file."""
    Path(place).write_bytes(pickle.dumps((_made_of(), codes)))


def _made_of():
    """What bitcode follows from: the package's sources, LLVM, and the kind of processor."""
    from llvmlite import binding as llvm

    texts = b"".join(path.read_bytes() for path in sorted(FOLDER.rglob("*.py")))
    kind = llvm.get_process_triple()
    return importlib.util.source_hash(texts), llvm.llvm_version_info, kind
