"""A file that one process at a time has, by which several share a folder."""

import fcntl
from pathlib import Path


class Lock:
    """A file that one process at a time has; the system takes it from one that was killed."""

    def __init__(self, path: Path, how: int = fcntl.LOCK_EX) -> None:
        self.path, self.how = path, how

    def __enter__(self) -> bool:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.file = open(self.path, "w")
        try:
            fcntl.flock(self.file, self.how)
        except BlockingIOError:
            return False
        return True

    def __exit__(self, *_) -> None:
        self.file.close()
