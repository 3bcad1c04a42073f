"""The runs of engines: each is kept with the files that the engine was given."""

import contextlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..running import run
from ..running.store import Store, digest
from .engine import Course, Engine, Failed, Samples
from .water import Water


@dataclass
class Runs:
    """Runs of a water in a folder.

    Attributes:
        versions: of the engines that are here, by name.
        silence: s without a sign of life after which a run is given up.
        lost: why runs have no result that is kept, by name.
    """

    water: Water
    folder: Path
    versions: Mapping[str, str]
    silence: float
    lost: dict[str, str] = field(default_factory=dict)

    def do(self, wanted: Mapping[str, tuple[str, Engine, Course]], meter: run.Meter) -> bool:
        """Do the runs that are not there yet, by name, with a label; several processes share them.

        Returns:
            whether a Ctrl-C came.
        """
        try:
            for name in self._store.shared(wanted):
                label, engine, course = wanted[name]
                meter.begin(label, course.steps)
                meter.end(self._once(name, engine, course, meter))
        except KeyboardInterrupt:
            return True
        return False

    def found(self, name: str, engine: Engine, course: Course) -> tuple[Samples | None, str | None]:
        """What is kept of a run: its samples, or why it failed; neither if it is not there."""
        kept = self._store.kept(name, self._origin(engine, self.inputs(engine, course)))
        record = kept["record"] if kept else {}
        if samples := record.get("samples"):
            step, potential, pressure, seconds = samples
            return Samples(np.array(step), np.array(potential), np.array(pressure), seconds), None
        return None, record.get("error", self.lost.get(name))

    def inputs(self, engine: Engine, course: Course) -> dict[str, str]:
        """The files that the engine is given, by name."""
        return engine.inputs(course, self.water)

    @property
    def _store(self) -> Store:
        return Store(self.folder, __name__)

    def _origin(self, engine: Engine, inputs: Mapping[str, str]) -> str:
        """A run follows from what the engine was given, as one of LAMMPS from its job."""
        return digest(engine.name, self.versions.get(engine.name), inputs)

    def _once(self, name: str, engine: Engine, course: Course, meter: run.Meter) -> str | None:
        """Do a run, or take it over; why it failed."""
        inputs = self.inputs(engine, course)
        origin = self._origin(engine, inputs)
        kept = self._store.kept(name, origin)
        if kept:
            return kept["record"]["error"]
        place = self.folder / name
        with contextlib.suppress(FileNotFoundError):
            shutil.rmtree(place)
        place.mkdir(parents=True)
        for file, text in inputs.items():
            (place / file).write_text(text)
        record: dict = {"error": None, "samples": None}
        try:
            samples = engine.run(course, place, self.silence, meter.at)
            if not np.isfinite([samples.potential, samples.pressure]).all():
                raise Failed("energy is not finite")
            record["samples"] = [*(one.tolist() for one in samples[:3]), samples.seconds]
        except Failed as error:
            record["error"] = str(error)
            if not error.lasts:
                self.lost[name] = str(error)
                return str(error)
        self._store.keep(name, origin, record)
        return record["error"]
