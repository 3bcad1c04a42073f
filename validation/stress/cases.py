"""All cases, by name, in the order of the tables."""

from . import contact, molecules, reported, tops

CASES = {case.name: case for room in (molecules, tops, contact, reported) for case in room.CASES}
