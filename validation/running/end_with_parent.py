"""Run a command that ends with its parent process: ``python end_with_parent.py PID WORD ...``.

PID is the parent.  When it is killed the command gets SIGTERM: otherwise it would go on, and write
to files of a run that another process of the harness has begun again.  (Linux keeps this setting
when a program is replaced by another.)  It is not done between fork and exec, because Python must
not run there if there are threads.
"""

import ctypes
import os
import signal
import sys

SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl


def main() -> None:
    starter, *words = sys.argv[1:]
    ctypes.CDLL(None).prctl(SET_DEATH_SIGNAL, signal.SIGTERM)
    if os.getppid() != int(starter):  # it ended before
        sys.exit(1)
    for ignored in signal.SIGPIPE, signal.SIGXFSZ:  # by Python, which programs would inherit
        signal.signal(ignored, signal.SIG_DFL)
    try:
        os.execvp(words[0], words)
    except OSError as error:
        sys.exit(f"ERROR: {words[0]} cannot be started: {error.strerror}")


if __name__ == "__main__":
    main()
