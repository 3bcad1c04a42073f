"""All cases of the stability atlas, by name, in the order of the table."""

from validation.stability import contact as stability_contact
from validation.stability import molecules as stability_molecules
from validation.stability import tops as stability_tops

CASES = {
    case.name: case
    for case in (*stability_molecules.CASES, *stability_tops.CASES, *stability_contact.CASES)
}
