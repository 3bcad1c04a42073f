"""The compiled loops of `sharing`: who holds what, and the packing and adding of what is exchanged."""

from .compiled import F1, F2, I, L1, loop


@loop
def meet(ids: L1, order: L1, first: L1, many: L1) -> I:
    """Find equal entries of ids: with `order`, which sorts them, entry i equals those from order[first[i]] on, many[i] in all.

    Returns the sum of many.
    """
    total = begin = 0
    while begin < ids.size:
        end = begin
        while end < ids.size and ids[order[end]] == ids[order[begin]]:
            end += 1
        for k in range(begin, end):
            first[order[k]], many[order[k]] = begin, end - begin
        total += (end - begin) * (end - begin)
        begin = end
    return total


@loop
def list_all(values: L1, order: L1, first: L1, many: L1, listed: L1):
    """List, for each entry of `meet`, the values of its equals."""
    n = 0
    for i in range(many.size):
        for k in range(first[i], first[i] + many[i]):
            listed[n] = values[order[k]]
            n += 1


@loop
def connect(places: L1, many: L1, ranks: L1, own: I, home: L1, partners: L1, counts: L1, bodies: L1, first: L1, source: L1,
            sent: L1, sizes: L1):  # fmt: skip
    """Find out with whom this rank, `own`, shares which bodies, and how their parts lie in what it sends and receives.

    The body at places[i] is held by the next many[i] entries of ranks; the first of them becomes its home.
    partners[p] shares counts[p] bodies; what is sent is in the order of the partners, for each that of places, and
    `sent` are the places.  What is received is in the same order: the parts of bodies[i] are those of source[first[i]] to
    source[first[i + 1]], and -1 there is this rank's part.  sizes: the numbers of bodies and of partners.
    """
    shared = npartners = entries = begin = 0
    for i in range(places.size):
        home[places[i]] = ranks[begin]
        end = begin + many[i]
        if many[i] > 1:
            for k in range(begin, end):
                source[entries] = -1
                if ranks[k] != own:
                    p = 0
                    while p < npartners and partners[p] != ranks[k]:
                        p += 1
                    if p == npartners:
                        partners[p], counts[p] = ranks[k], 0
                        npartners += 1
                    source[entries] = p
                    counts[p] += 1
                entries += 1
            bodies[shared] = places[i]
            shared += 1
            first[shared] = entries
        begin = end
    # counts serve as the next free entry of each partner, and are what they were at the end
    last = 0
    for p in range(npartners):
        last += counts[p]
        counts[p] = last - counts[p]
    for i in range(shared):
        for k in range(first[i], first[i + 1]):
            p = source[k]
            if p >= 0:
                source[k] = counts[p]
                sent[counts[p]] = bodies[i]
                counts[p] += 1
    for p in range(npartners - 1, 0, -1):
        counts[p] -= counts[p - 1]
    sizes[0], sizes[1] = shared, npartners


@loop
def pack(values: F2, bodies: L1, packed: F1):
    """Copy the columns `bodies` of values, one after the other, to packed."""
    rows = values.shape[0]
    for k in range(bodies.size):
        for row in range(rows):
            packed[rows * k + row] = values[row, bodies[k]]


@loop
def add(values: F2, bodies: L1, first: L1, source: L1, received: F1):
    """Set the columns `bodies` of values to the sums of their parts, added in their order; see `connect`."""
    rows = values.shape[0]
    for i in range(bodies.size):
        for row in range(rows):
            total = 0.0
            for k in range(first[i], first[i + 1]):
                total += values[row, bodies[i]] if source[k] < 0 else received[rows * source[k] + row]
            values[row, bodies[i]] = total
