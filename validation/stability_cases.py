"""All cases of the stability atlas, by name, in the order of the table."""

from validation import stability_contact, stability_molecules, stability_tops

CASES = {
    case.name: case
    for case in (*stability_molecules.CASES, *stability_tops.CASES, *stability_contact.CASES)
}
