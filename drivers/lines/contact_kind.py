"""The kind ``contact`` of gauges in site files."""

import re

from drivers.interface import Gauge
from drivers.kind import Kind, Setting, Surroundings
from drivers.lines.kind import IGNORE, LINK, address_of, open_source
from drivers.lines.patience import slow_on


async def _open(around: Surroundings) -> Gauge:
    from drivers.lines.contact import ContactPattern, ContactProbe

    settings = around.settings
    device = f"probe {settings['source']}"
    pattern = ContactPattern(settings["touches"], settings["open"], settings["ignore"])
    source = await open_source(settings, device)
    ask = settings["ask"].encode().decode("unicode_escape")
    return ContactProbe(source, pattern, ask, settings["silence_s"], device)


def _no_pattern(text: str) -> str:
    """What is wrong with a pattern that is searched for, in words; empty if nothing."""
    try:
        compiled = re.compile(text)
    except re.error as error:
        return f"no pattern: {error}"
    if compiled.search(""):
        return "it is found in every line, an empty one too"
    return slow_on(compiled, anywhere=True)


KIND: Kind[Gauge] = Kind(
    says="A touch-trigger probe or an electric contact that says by lines whether it touches",
    settings=(
        *LINK,
        Setting("touches", "text", "pattern of lines that say so, as TRIGGERED", check=_no_pattern),
        Setting("open", "text", "pattern of lines that say that not, as open", check=_no_pattern),
        IGNORE,
        Setting("ask", "text", r"what is sent to hear it, as ?\n; empty: it speaks by itself", ""),
        Setting("silence_s", "number", "seconds without a line that are a fault", 5.0, least=0.1),
    ),
    open=_open,
    address=address_of,
    tells="contact",
)
