"""How a class driven by ``fix python/move`` ends a run."""


class RunError(Exception):
    """Raised when the run must end; its text is the message that the user reads.

    Args:
        message: What is wrong, what was expected and what to do.
        everywhere: True says that every rank raises it, so that LAMMPS can end the run in order;
            False that this rank may be alone, so that the others have to be stopped.
        argument: Which argument of LAMMPS's command is wrong, from 0 on; None for none.
    """

    def __init__(
        self, message: str, *, everywhere: bool = False, argument: int | None = None
    ) -> None:
        super().__init__(message)
        self.everywhere, self.argument = everywhere, argument


def refuse(problem: object, why: str) -> None:
    """End the run for a problem that all ranks know of.

    Raises:
        RunError: if there is one.
    """
    if problem:
        raise RunError(why, everywhere=True)
