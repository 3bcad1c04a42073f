"""The compiled loops of `sharing`: who holds what, and the packing and adding of what is exchanged."""

from .compiled import F1, F2, I, L1, inlined, loop

# what these loops count, in `counts`: bodies of this rank, those that may be shared, ranks asked for their holders; shared bodies,
# partners, bodies sent to them; numbers for which there was no room; whether all is found
BODIES, ASKED, HOMES, SHARED, PARTNERS, SENT, NEEDED, KNOWN, COUNTS = range(9)


@inlined
def sort(order, spare, n, high, low):
    """Fill order with 0 to n - 1 so that high, and where it is equal low, does not fall; merges longer and longer runs."""
    for i in range(n):
        order[i] = i
    width = 1
    while width < n:
        for begin in range(0, n, 2 * width):
            middle, end = min(begin + width, n), min(begin + 2 * width, n)
            a, b = begin, middle
            for k in range(begin, end):
                first = a < middle
                if first and b < end:
                    i, j = order[a], order[b]
                    first = high[i] < high[j] or (high[i] == high[j] and low[i] <= low[j])
                if first:
                    spare[k] = order[a]
                    a += 1
                else:
                    spare[k] = order[b]
                    b += 1
        for k in range(n):
            order[k] = spare[k]
        width *= 2


@loop
def ask(
    asked: L1,
    ids: L1,
    home: L1,
    order: L1,
    spare: L1,
    places: L1,
    questions: L1,
    homes: L1,
    many: L1,
    counts: L1,
):
    """Put the bodies that may be shared in an order on which two holders of the same bodies agree: of home and ID.

    Args:
        asked, ids, home (counts[ASKED],): the bodies' places, their IDs, the rank at which all holders of each meet.
        order, spare: to work with.
        places, questions (counts[ASKED],): out: the same places and IDs, in order.
        homes, many (counts[HOMES],): out: each of these ranks, and how many of the bodies meet there.
    """
    n, ranks = counts[ASKED], 0
    sort(order, spare, n, home, ids)
    for k in range(n):
        i = order[k]
        places[k], questions[k] = asked[i], ids[i]
        if ranks == 0 or homes[ranks - 1] != home[i]:
            homes[ranks], many[ranks] = home[i], 0
            ranks += 1
        many[ranks - 1] += 1
    counts[HOMES] = ranks


@loop
def answer(
    ids: L1,
    askers: L1,
    asked: L1,
    order: L1,
    spare: L1,
    owner: L1,
    first: L1,
    answers: L1,
    parts: L1,
    counts: L1,
) -> I:
    """Tell ranks that ask who holds bodies who else has asked.

    Args:
        ids (n,): the IDs that askers[r] asks for are the next asked[r] entries.
        order, spare, owner, first: to work with.
        answers: out: for each asker how many hold each of its bodies, then which ranks, body by body.
        parts: out: how many numbers each asker's part has.
    Returns:
        0, or 1 if there is no room: counts[NEEDED] numbers.
    """
    n, total, begin, i = ids.size, 0, 0, 0
    if n > order.size or askers.size > parts.size:
        counts[NEEDED] = max(n, askers.size)
        return 1
    for r in range(askers.size):
        for _ in range(asked[r]):
            owner[i] = r
            i += 1
    sort(order, spare, n, ids, owner)
    while begin < n:
        end = begin
        while end < n and ids[order[end]] == ids[order[begin]]:
            end += 1
        for k in range(begin, end):
            first[order[k]], spare[order[k]] = begin, end - begin
        total += (end - begin) * (1 + end - begin)
        begin = end
    if total > answers.size:
        counts[NEEDED] = total
        return 1
    total = i = 0
    for r in range(askers.size):
        begin, end = i, i + asked[r]
        parts[r] = -total
        for i in range(begin, end):
            answers[total] = spare[i]
            total += 1
        for i in range(begin, end):
            for k in range(first[i], first[i] + spare[i]):
                answers[total] = askers[owner[order[k]]]
                total += 1
        parts[r] += total
        i = end
    return 0


@loop
def connect(places: L1, homes: L1, many: L1, answers: L1, own: I, home: L1, partners: L1, shares: L1, bodies: L1, first: L1, source: L1,
            sent: L1, counts: L1) -> I:  # fmt: skip
    """Find out with whom this rank, `own`, shares which bodies, and how their parts lie in what it sends and receives.

    answers has a part for each of the homes, with what it was asked of the next many[r] places: by how many ranks each of
    these bodies is held, then by which, body by body; the first of them is its home from now on.
    partners[p] shares shares[p] bodies; what is sent is in the order of the partners, for each that of places, and
    `sent` are the places.  What is received is in the same order: the parts of bodies[i] are those of source[first[i]] to
    source[first[i + 1]], and -1 there is this rank's part.  counts: see the head of this file.

    Returns:
        0, or 1 if there is no room: counts[NEEDED] numbers.
    """
    if answers.size > source.size:
        counts[NEEDED] = answers.size
        return 1
    for b in range(counts[BODIES]):
        home[b] = own
    shared = npartners = entries = end = place = 0
    first[0] = 0
    for r in range(counts[HOMES]):
        held, begin = end, end + many[r]
        for i in range(place, place + many[r]):
            home[places[i]] = answers[begin]
            end = begin + answers[held]
            if end > begin + 1:
                for k in range(begin, end):
                    source[entries] = -1
                    if answers[k] != own:
                        p = 0
                        while p < npartners and partners[p] != answers[k]:
                            p += 1
                        if p == npartners:
                            partners[p], shares[p] = answers[k], 0
                            npartners += 1
                        source[entries] = p
                        shares[p] += 1
                    entries += 1
                bodies[shared] = places[i]
                shared += 1
                first[shared] = entries
            held, begin = held + 1, end
        place += many[r]
    # shares serve as the next free entry of each partner, and are what they were at the end
    last = 0
    for p in range(npartners):
        last += shares[p]
        shares[p] = last - shares[p]
    for i in range(shared):
        for k in range(first[i], first[i + 1]):
            p = source[k]
            if p >= 0:
                source[k] = shares[p]
                sent[shares[p]] = bodies[i]
                shares[p] += 1
    for p in range(npartners - 1, 0, -1):
        shares[p] -= shares[p - 1]
    counts[SHARED], counts[PARTNERS], counts[SENT], counts[KNOWN] = shared, npartners, last, 1
    return 0


@loop
def pack(values: F2, sent: L1, packed: F1, counts: L1):
    """Copy the columns `sent` of values, one after the other, to packed."""
    rows = values.shape[0]
    for k in range(counts[SENT]):
        for row in range(rows):
            packed[rows * k + row] = values[row, sent[k]]


@loop
def add(values: F2, bodies: L1, first: L1, source: L1, received: F1, counts: L1):
    """Set the columns `bodies` of values to the sums of their parts, added in their order; see `connect`."""
    rows = values.shape[0]
    for i in range(counts[SHARED]):
        for row in range(rows):
            total = 0.0
            for k in range(first[i], first[i + 1]):
                total += (
                    values[row, bodies[i]] if source[k] < 0 else received[rows * source[k] + row]
                )
            values[row, bodies[i]] = total
