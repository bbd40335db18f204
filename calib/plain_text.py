"""Text as other programs write it: with a byte order mark, with the line ends of any system."""


def plain(text: str) -> str:
    """Take the byte order mark away and end every line with a line feed."""
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
