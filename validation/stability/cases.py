"""All cases of the stability atlas, by name, in the order of the table."""

from . import contact, molecules, tops

CASES = {case.name: case for room in (molecules, tops, contact) for case in room.CASES}
