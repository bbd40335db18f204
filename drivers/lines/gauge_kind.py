"""The kind ``lines`` of gauges in site files."""

from drivers.errors import DeviceError
from drivers.interface import Gauge
from drivers.kind import Kind, Setting, Surroundings
from drivers.lines.kind import IGNORE, LINK, address_of, open_source
from drivers.lines.number import PLAIN, UNITS, fault_in


async def _open(around: Surroundings) -> Gauge:
    from drivers.lines.gauge import GaugeSettings, LineGauge
    from drivers.lines.number import NumberPattern

    settings = around.settings
    device = f"gauge {settings['source']}"
    pattern = NumberPattern(
        settings["pattern"] or PLAIN, settings["unit"], settings["decimal"], settings["ignore"]
    )
    ask = settings["ask"].encode().decode("unicode_escape")
    own = GaugeSettings(settings["each"], ask, settings["silence_s"])
    source = await open_source(settings, device)
    gauge = LineGauge(source, pattern, own, device, around.time_scale)
    try:
        await gauge.first_line()
    except DeviceError:
        await gauge.close()
        raise
    return gauge


KIND: Kind[Gauge] = Kind(
    says="Any gauge or probe that sends its number as a line: TCP, serial, a file",
    settings=(
        *LINK,
        Setting(
            "each", "text", "a line is a sample of a stream, the answer to ask (reading), or made "
            "by somebody who presses a key", "reading", choices=("sample", "reading", "key"),
        ),
        Setting("unit", "text", "of the number where its line has none", choices=tuple(UNITS)),
        Setting("decimal", "text", "sign before decimals", ".", choices=(".", ",")),
        Setting(
            "pattern", "text", "of a whole line, with a group value (unit); empty: a number, "
            "perhaps with its unit", "", check=lambda text: fault_in(text) if text else "",
        ),
        IGNORE,
        Setting("ask", "text", r"what is sent for a reading, as ?\r; empty: nothing", ""),
        Setting("silence_s", "number", "seconds without a line that are a fault", 5.0, least=0.1),
    ),
    open=_open,
    address=address_of,
)  # fmt: skip
