"""Data packets as readings and samples."""

from collections.abc import Iterator

from drivers import plausible
from drivers.emscon import wire
from drivers.interface import TrackerReading, TrackSample


def reading(packet: wire.Packet, device: str, *, weather: bool) -> TrackerReading:
    """The mean of one dwell, from a packet of type 2 or 9.

    The a-priori standard deviations are taken as the uncertainty of the mean: the statistics of
    the samples know nothing of what is slower than the dwell. Covariances come with type 9 only.
    Without a weather station the packet's weather is what somebody typed, and is left out.
    Raises ProtocolError for numbers that are none or cannot be.
    """
    xyz = (packet.real("val1"), packet.real("val2"), packet.real("val3"))
    sigma = (packet.real("apriori1"), packet.real("apriori2"), packet.real("apriori3"))
    if not all(s > 0.0 for s in sigma):
        sigma = (packet.real("std1"), packet.real("std2"), packet.real("std3"))
    mixed = tuple(
        packet.real(name) if name in packet.fields else 0.0
        for name in ("apriori_covar12", "apriori_covar13", "apriori_covar23")
    )
    plausible.place(xyz, device)
    plausible.uncertainty(sigma, mixed, device)

    def air(name: str) -> float:
        return plausible.weather(name, packet.real(name), device)

    return TrackerReading(
        xyz=xyz,
        covariance=(sigma[0] ** 2, sigma[1] ** 2, sigma[2] ** 2, mixed[0], mixed[1], mixed[2]),
        temperature_C=air("temperature") if weather else None,
        pressure_hPa=air("pressure") if weather else None,
        humidity=air("humidity") if weather else None,
    )


def samples(packet: wire.Packet, device: str) -> Iterator[TrackSample]:
    """The records of a continuous-mode packet (type 3); time = seconds + microseconds.

    Raises ProtocolError for valid ones that cannot be.
    """
    for record in packet.records:
        xyz = (float(record["val1"]), float(record["val2"]), float(record["val3"]))
        valid = record["status"] == 0
        if valid:
            plausible.place(xyz, device)
        yield TrackSample(
            time_s=float(record["seconds"]) + 1e-6 * float(record["microseconds"]),
            xyz=xyz,
            valid=valid,
        )
