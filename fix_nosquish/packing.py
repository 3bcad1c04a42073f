"""The compiled loops of `sharing`: who holds what, and the packing and adding of what is exchanged."""

from .compiled import F1, F2, I, L1, loop


@loop
def meet(ids: L1, order: L1, first: L1, many: L1) -> I:
    """Find equal entries of ids: with `order`, which sorts them, entry i equals those from order[first[i]] on, many[i] in all.

    Returns how many numbers `answer` gives.
    """
    total = begin = 0
    while begin < ids.size:
        end = begin
        while end < ids.size and ids[order[end]] == ids[order[begin]]:
            end += 1
        for k in range(begin, end):
            first[order[k]], many[order[k]] = begin, end - begin
        total += (end - begin) * (1 + end - begin)
        begin = end
    return total


@loop
def answer(ids: L1, order: L1, first: L1, many: L1, bounds: L1, askers: L1, answers: L1, ends: L1):
    """Tell ranks that ask who holds bodies who else has asked.

    Args:
        ids (n,): the IDs that askers[r] asks for are entries bounds[r] to bounds[r + 1]; they are overwritten.
        order, first, many (n,): see `meet`.
        answers: out: for each asker how many hold each of its bodies, then which ranks, body by body.
        ends (askers + 1,): out: where each asker's part begins, and the end.
    """
    for r in range(askers.size):  # ranks in the order of the IDs, as `first` points there
        for i in range(bounds[r], bounds[r + 1]):
            ids[i] = askers[r]
    n = 0
    for r in range(askers.size):
        ends[r] = n
        for i in range(bounds[r], bounds[r + 1]):
            answers[n] = many[i]
            n += 1
        for i in range(bounds[r], bounds[r + 1]):
            for k in range(first[i], first[i] + many[i]):
                answers[n] = ids[order[k]]
                n += 1
    ends[askers.size] = n


@loop
def connect(places: L1, asked: L1, answers: L1, own: I, home: L1, partners: L1, counts: L1, bodies: L1, first: L1, source: L1,
            sent: L1, sizes: L1):  # fmt: skip
    """Find out with whom this rank, `own`, shares which bodies, and how their parts lie in what it sends and receives.

    answers has a part for each rank that was asked, with what it was asked of the next asked[r] places: by how many ranks each of
    these bodies is held, then by which, body by body; the first of them becomes its home.
    partners[p] shares counts[p] bodies; what is sent is in the order of the partners, for each that of places, and
    `sent` are the places.  What is received is in the same order: the parts of bodies[i] are those of source[first[i]] to
    source[first[i + 1]], and -1 there is this rank's part.  sizes: the numbers of bodies and of partners.
    """
    shared = npartners = entries = end = place = 0
    for r in range(asked.size):
        many, begin = end, end + asked[r]
        for i in range(place, place + asked[r]):
            home[places[i]] = answers[begin]
            end = begin + answers[many]
            if end > begin + 1:
                for k in range(begin, end):
                    source[entries] = -1
                    if answers[k] != own:
                        p = 0
                        while p < npartners and partners[p] != answers[k]:
                            p += 1
                        if p == npartners:
                            partners[p], counts[p] = answers[k], 0
                            npartners += 1
                        source[entries] = p
                        counts[p] += 1
                    entries += 1
                bodies[shared] = places[i]
                shared += 1
                first[shared] = entries
            many, begin = many + 1, end
        place += asked[r]
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
