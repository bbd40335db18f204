"""What can be wrong with what a person gave us, said with the place and the remedy."""


class BadInput(Exception):
    """A file or an argument that cannot be used; the program ends with exit code 2.

    Parameters
    ----------
    what : str
        What was found, in words.
    place : str, optional
        Where: ``"points.csv, line 12, column sx"`` or ``"hexapod.toml, line 40"``.
    remedy : str, optional
        What was expected, or what to do about it.
    """

    def __init__(self, what: str, *, place: str = "", remedy: str = "") -> None:
        self.what = what
        self.place = place
        self.remedy = remedy
        text = f"{place}: {what}" if place else what
        super().__init__(f"{text}. {remedy}" if remedy else text)
