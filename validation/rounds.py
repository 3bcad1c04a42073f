"""Runs timed in turn (A B C A B C ...), each a fresh process on the same start.

So a change in the machine's load meets all of them alike, and numbers of one round compare like with like.
"""

from dataclasses import dataclass

import numpy as np

from validation import measures, run

SETUPS = 2  # `run 0` before the steps: the first one also reads or compiles code
SEGMENTS = 3  # timed segments of a process
LEAST = 40  # steps of a segment: the last one writes output, and every tenth or so re-neighbours


@dataclass(frozen=True)
class Lengths:
    """Steps of a process: untimed ones first, then segments."""

    warm_up: int
    segment: int
    segments: int

    @property
    def runs(self):
        """The list of a job's runs."""
        return [self.warm_up] + [self.segment] * self.segments


def lengths(loop, seconds):
    """Segments that last so long.

    Args:
        loop: s of a step.
        seconds: of a segment; at least `LEAST` steps, and if those last longer, fewer segments.
    """
    segment = max(LEAST, round(seconds / loop))
    segments = min(SEGMENTS, max(1, round(SEGMENTS * seconds / (segment * loop))))
    return Lengths(max(3, min(1000, segment // 5)), segment, segments)


def calibrate(make, on_step=lambda step: None):
    """s of a step of the job ``make(runs)``, or its ``Result`` if it fails."""
    steps = LEAST
    while True:
        result = run.run(make([3, steps]), on_step)
        if result.error:
            return result
        loop = result.timings[-1]["loop"]
        if loop > 0.05 or steps >= 10000:
            return loop / steps
        steps = min(10000, int(0.2 * steps / max(loop, 1e-6)))


def in_turn(jobs, rounds, meter):
    """Run all jobs in each of so many rounds; one that fails is not run again.

    Args:
        jobs: name to (label, function of the round's number that makes a ``Job``).
        meter: a ``console.Meter``.

    Returns:
        (found, errors, interrupted): name to the list of its rounds' numbers (see ``numbers``), name to
        why it failed, and whether a Ctrl-C ended it all.
    """
    found, errors = {name: [] for name in jobs}, {}
    for number in range(1, rounds + 1):
        for name, (label, make) in jobs.items():
            if name in errors:
                continue
            meter.begin(f"{label}, {number}/{rounds}", 1)
            job = make(number)
            result = run.run(job)
            meter.end(result.error)
            if result.interrupted:
                return found, errors, True
            if result.error:
                errors[name] = result.error
            else:
                found[name].append(numbers(job, result))
    return found, errors, False


def numbers(job, result):
    """What is kept of a completed run, as plain data.

    ``modify``, ``loop`` and each of ``sections`` (us per step): medians of the segments after the warm-up;
    ``cpu``: the smallest share of a core in these, in percent; ``define`` and ``setups``: s that
    the fixes' commands and each `run 0` took; ``memory``: KiB of each rank at most; ``versions``.
    """
    segments = result.timings[job.setups + 1 :]
    kept = {
        "define": sum(
            time
            for command, time in zip(job.commands, result.seconds["commands"])
            if command.startswith("fix ")
        ),
        "setups": result.seconds["setups"],
        "memory": result.memory,
        "versions": result.versions,
    }
    if segments:
        per_step = [
            {name: time / one["steps"] * 1e6 for name, time in one["sections"].items()}
            for one in segments
        ]
        kept |= {
            "sections": {
                name: float(np.median([one[name] for one in per_step])) for name in per_step[0]
            },
            "modify": float(np.median([one["Modify"] for one in per_step])),
            "loop": float(np.median([one["loop"] / one["steps"] for one in segments])) * 1e6,
            "steps": [one["steps"] for one in segments],
        }
        shares = [one["cpu"] for one in segments if one["cpu"] is not None]
        if shares:
            kept["cpu"] = min(shares)
    return kept


def spread(rounds, key):
    """Median, minimum and maximum over rounds of one of their numbers; None if there is none."""
    values = [one[key] for one in rounds if key in one]
    return measures.spread(values) if values else None


def ratio(ours, theirs, key):
    """Spread of ours over theirs, each pair of one round; None if there is no pair."""
    pairs = [(a[key], b[key]) for a, b in zip(ours, theirs) if key in a and b.get(key)]
    return measures.spread(a / b for a, b in pairs) if pairs else None


def difference(own, other, of):
    """Spread of own minus other, each pair of one round; None if there is no pair.

    Args:
        of: function of a round's numbers.
    """
    pairs = [(of(a), of(b)) for a, b in zip(own, other)]
    return measures.spread(a - b for a, b in pairs) if pairs else None
