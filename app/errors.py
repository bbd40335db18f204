"""How a job of the operator's can end, besides well, with bad input or with a device error."""


class StoppedByOperator(Exception):
    """The operator stopped the job; the machine stands still. Exit code 4."""

    def __init__(self, what: str = "stopped by the operator", *, remedy: str = "") -> None:
        self.what = what
        self.remedy = remedy
        super().__init__(f"{what}. {remedy}" if remedy else what)


class GateRefused(Exception):
    """A safety gate said no; nothing was changed that was not put back. Exit code 5.

    Parameters
    ----------
    what : str
        Which gate refused, and why, with the numbers.
    remedy : str, optional
        What the operator can do about it.
    gates : tuple of str, optional
        Those of the write-back that refused, by name.
    """

    def __init__(self, what: str, *, remedy: str = "", gates: tuple[str, ...] = ()) -> None:
        self.what = what
        self.remedy = remedy
        self.gates = gates
        super().__init__(f"{what}. {remedy}" if remedy else what)

    @property
    def nothing_to_gain(self) -> bool:
        """Whether all else is well: the machine has as good parameters already."""
        return self.gates == ("gain",)
