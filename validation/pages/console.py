"""Progress in the terminal; plain lines if the output is not a terminal."""

import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

WIDE = 150  # columns, where the output is not a terminal


def console() -> Console:
    """Standard output."""
    output = Console(highlight=False)
    return output if output.is_terminal else Console(width=WIDE, highlight=False)


class Meter:
    """Progress bars for the current run and for all runs; a line for each finished run.

    Args:
        console: output.
        total: steps of all runs together.
        unit: what is counted.
    """

    def __init__(self, console: Console, total: int, unit: str = "steps") -> None:
        self.console, self.unit, self.done = console, unit, 0
        self.progress = Progress(
            TextColumn("{task.description:<34}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(unit),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self.all = self.progress.add_task("all runs", total=total)

    def __enter__(self) -> "Meter":
        self.progress.start()
        return self

    def __exit__(self, *_) -> None:
        self.progress.stop()

    def begin(self, label: str, total: int) -> None:
        """Start a run of ``total`` steps."""
        self.label, self.total, self.start = label, total, time.monotonic()
        self.current = self.progress.add_task(label, total=total)

    def at(self, step: float) -> None:
        """Set the progress of the run to ``step``."""
        self.progress.update(self.current, completed=step)
        self.progress.update(self.all, completed=self.done + step)

    def end(self, error: str | None) -> None:
        """End the run: successful if ``error`` is None."""
        self.at(self.total)
        self.done += self.total
        self.progress.remove_task(self.current)
        seconds = time.monotonic() - self.start
        note = f"failed: {error[:70]}" if error else f"{self.total} {self.unit}" * (self.total > 1)
        self.console.print(f"{self.label:<34} {seconds:6.1f} s  {note}", markup=False)
