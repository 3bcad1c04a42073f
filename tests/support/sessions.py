"""LAMMPS processes that run one script after the other, each script with a LAMMPS of its own.

A start (mpirun, LAMMPS, the interpreter, numpy, the compiled loops) takes longer than most tests'
scripts. While they wait for a script the processes use no core. What they cannot go on after ends
them, as it ends LAMMPS: an abort, a crash, a hang.
"""

import ctypes
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def environment():
    """What a process that is started now gets, but for what pytest sets for each test."""
    return {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}


class Session:
    """The processes of some ranks.

    Args:
        mpirun: the words before a rank's own command, or none.
        ranks: how many there are.
    """

    def __init__(self, mpirun, ranks):
        self.ended, self._environment = False, environment()
        self._folder = tempfile.TemporaryDirectory()
        self._screen, address = (f"{self._folder.name}/{name}" for name in ("screen", "socket"))
        with socket.socket(socket.AF_UNIX) as server, open(self._screen, "ab") as screen:
            server.bind(address)
            server.listen(ranks)
            server.settimeout(120)
            self._process = subprocess.Popen(
                [*mpirun, sys.executable, __file__, address, self._screen],
                cwd=self._folder.name,
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=screen,
            )
            self._ranks = [server.accept()[0] for _ in range(ranks)]

    def serves(self):
        """Whether it can run what this process would start now."""
        return not self.ended and environment() == self._environment

    def run(self, folder, options, timeout):
        """Run the script in.test of a folder there.

        Returns:
            (int, text): zero or the code of a failure; what came on the screen.
        Raises:
            subprocess.TimeoutExpired: if it takes longer than so many seconds.
        """
        Path(self._screen).write_bytes(b"")
        until, codes = time.monotonic() + timeout, []
        try:
            for rank in self._ranks:
                rank.sendall(json.dumps([str(folder), *options]).encode())
            for rank in self._ranks:
                rank.settimeout(max(until - time.monotonic(), 0.1))
                codes.append(int(rank.recv(1)))
        except TimeoutError:
            self.end(patience=0)
            raise subprocess.TimeoutExpired("in.test", timeout) from None
        except (OSError, ValueError):  # a rank has ended, and mpirun ends the others
            self.end()
            codes.append(self._process.returncode or 1)
        return max(codes, key=abs), Path(self._screen).read_text(errors="replace")

    def end(self, patience=30):
        """End the processes: those that wait for a script end by themselves, in so many seconds."""
        self.ended = True
        for rank in self._ranks:
            rank.close()
        try:
            self._process.wait(patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def serve(address, screen):
    """What a rank does: run what comes."""
    import lammps
    from lammps.core import MPIAbortException

    library, scripts = ctypes.CDLL(None), socket.socket(socket.AF_UNIX)
    output = os.open(screen, os.O_WRONLY | os.O_APPEND)  # mpirun's pipes may come late
    os.dup2(output, 1)
    os.dup2(output, 2)
    scripts.connect(address)
    while job := scripts.recv(1 << 16):
        folder, *options = json.loads(job)
        os.chdir(folder)
        run, code = None, b"0"
        try:
            run = lammps.lammps(cmdargs=options)
            run.file("in.test")
        except MPIAbortException:
            library.fflush(None)
            os._exit(1)
        except Exception:
            code = b"1"
        if run:
            run.close()
        library.fflush(None)
        os.chdir("/")
        for name, module in list(sys.modules.items()):  # the next folder has others of its name
            if (getattr(module, "__file__", None) or "").startswith(folder):
                del sys.modules[name]
        sys.path_importer_cache.pop(".", None)
        scripts.sendall(code)
    lammps.lammps(cmdargs=["-log", "none", "-screen", "none"]).finalize()


if __name__ == "__main__":
    serve(*sys.argv[1:])
