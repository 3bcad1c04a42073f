"""Forces that graphics cards compute: what LAMMPS copies for this fix, which moves bodies on the
host, and which combinations are refused."""

from collections.abc import Collection
from typing import NamedTuple

from ..errors import refuse
from ..host.lammps import Lammps

_PRECISIONS = "double", "mixed", "single"
_BYTES = 3 * 24  # of an atom, in a step: its force to the host, its position there and back


class Cards(NamedTuple):
    """Packages by which LAMMPS computes forces, besides its own way.

    Attributes:
        gpu: the precision of the package GPU if it is in use, else empty.
        kokkos: the precision of KOKKOS if it is on, else empty.
        number: how many cards a node has for KOKKOS.
    """

    gpu: str = ""
    kokkos: str = ""
    number: int = 0

    def refuse(self, *, energy: bool, levels: bool, counts: bool) -> None:
        """End a run that would be wrong with these packages.

        Args:
            energy: whether the integrator needs the potential energy within a run.
            levels: whether the run has the levels of run_style respa.
            counts: see `hosts.Host`.
        """
        refuse(
            self.gpu and counts,
            "the package GPU adds its forces where fixes add theirs. Another fix changes "
            "forces here that the pressure must not count, and nothing tells the two apart: "
            "use pair styles without the suffix gpu, or leave that fix out",
        )
        refuse(
            self.gpu and levels,
            "with run_style respa the package GPU begins a run with the forces of pairs in the "
            "outermost level, whichever they belong to: use pair styles without the suffix gpu",
        )
        refuse(
            self.kokkos not in ("", "double"),
            f"this KOKKOS has {self.kokkos} precision, and rounds the positions that this fix "
            "gives atoms: use one that was built with KOKKOS_PREC=double",
        )
        needs_energy = "hybrid Monte Carlo has forces computed anew within a step"
        refuse(
            self.number and (energy or levels),
            f"{'run_style respa has forces computed by levels' if levels else needs_energy}, and "
            "KOKKOS then leaves them on the card: start LAMMPS without -k on, or use a KOKKOS that "
            "was built for the host only",
        )

    def copies(self, places: int) -> list[str]:
        """Lines for the log, none where nothing is copied.

        Args:
            places: in LAMMPS's arrays of atoms on all ranks, for ghost atoms and in reserve, too.
        """
        if not self.number:
            return []
        return [
            f"  KOKKOS on a card: each step copies {_BYTES * places / 1e6:.3g} MB for this fix, "
            "forces to the host, and positions to the host and back. This was not tested on a "
            "card: compare the energies with those of a run on the host"
        ]


def find(lammps: Lammps, packages: Collection[str]) -> Cards:
    """The packages of this run. Args: packages: see `OtherFixes`."""

    def precision(package: str, active: bool) -> str:
        known = (word for word in _PRECISIONS if lammps.has_precision(package, word))
        return next(known, "unknown") if active else ""

    return Cards(
        gpu=precision("GPU", "GPU" in packages),
        kokkos=precision("KOKKOS", lammps.setting("kokkos_active") > 0),
        number=max(0, lammps.setting("kokkos_ngpus")),  # -1 where LAMMPS does not know the word
    )
