"""A station for scripts and notebooks: every call returns when its job is done."""

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from app.defaults import REFERENCE_EVERY
from app.files.pose_table import Pose
from app.files.site import Site
from app.jobs.automatic import AutoReport
from app.jobs.chosen_runs import File
from app.jobs.measuring import SessionReport
from app.jobs.verifying import VerificationReport
from app.session.events import Event
from pkmcal.async_station import AsyncStation, Operator, Order
from pkmcal.own_loop import OwnLoop
from pkmcal.parameter_sets import ParameterSets


class Station(ParameterSets):
    """One site's controller and tracker, for scripts: measure, verify, write back, undo.

    The devices are connected by :meth:`connect`, or by the first job, and stay connected until
    :meth:`close`; ``with`` does both. The event loop is the station's own, in a thread of its own,
    so that it works in a notebook too. Ctrl-C stops all motion first; the call then ends with
    :class:`StoppedByOperator`, and :meth:`resume` goes on.

    Parameters
    ----------
    site : path
        Site file: addresses, nests, who carries SMRs.
    folder : path
        Where sessions get their folders.
    operator : callable, optional
        Stands for the person at the machine: called with a question and the possible answers,
        returns one of them when it is so ("Put the SMR into nest 4 ...", ("done", "stop")). It may
        take its time: it runs in a thread of its own. Without, nobody answers: questions get
        their default answers, and where a person is indispensable the job ends with a DeviceError
        that says so. A mock's SMRs are carried by the mock.
    watch : callable, optional
        Told every event of the jobs (``app.session.events``) in the station's own thread; it must
        return at once.

    Raises
    ------
    BadInput
        If the site file cannot be read.

    Examples
    --------
    >>> with pkmcal.Station("site.toml") as station:                         # doctest: +SKIP
    ...     measured = station.measure("poses.toml")
    ...     found = pkmcal.fit(measured.run)
    ...     found.save("model.toml")
    ...     done = station.apply("model.toml", yes=True)
    ...     print(station.verify().measured.position_peak_um)
    """

    def __init__(
        self,
        site: File,
        *,
        folder: File = "sessions",
        operator: Operator | None = None,
        watch: Callable[[Event], None] | None = None,
    ) -> None:
        self._station = AsyncStation(site, folder=folder, operator=operator, watch=watch)
        self._loop = OwnLoop(self._station.stop)

    @property
    def site(self) -> Site:
        """The site file, checked."""
        return self._station.site

    def __enter__(self) -> Self:
        try:
            self.connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def connect(self) -> None:
        """Own the machine and connect to both devices.

        Raises
        ------
        GateRefused
            If another process owns the machine.
        DeviceError
            If a device does not answer, or is not the one that the site file names.
        """
        self._loop.wait(self._station.connect())

    def close(self) -> None:
        """Let go of the devices and of the machine."""
        self._loop.close(self._station.close)

    def stop(self) -> None:
        """Stop all motion now, from another thread; the job under way ends: StoppedByOperator."""
        self._loop.wait(self._station.stop())

    def measure(
        self,
        poses: File | Mapping[str, Pose],
        *,
        order: Order | None = None,
        reference_every: int = 10,
        cycles: int = 1,
        warm_up: bool = True,
        title: str = "",
        pairs: Sequence[tuple[str, str]] = (),
    ) -> SessionReport:
        """Visit all poses with an SMR in each nest, or read a gauge there, and write a run.

        Parameters
        ----------
        poses : path or mapping
            A poses file, or label -> x, y, z (mm), rx, ry, rz (rad): the platform in the base
            frame, in this order.
        order : "nest-by-nest" or "pose-by-pose", optional
            One SMR carried from nest to nest, or SMRs in all nests; by the SMRs at hand if None.
        reference_every : int
            Poses between two looks at the base nests.
        cycles : int
            How many times all poses are visited.
        warm_up : bool
            Wait until temperatures are steady.
        title : str
            Title of the run.
        pairs : sequence of (str, str)
            With a gauge that reads distances: labels of two poses, where the tool leaves marks.

        Returns
        -------
        SessionReport
            ``run`` is the folder of the run.

        Raises
        ------
        BadInput
            For poses that cannot be read.
        DeviceError
            On a fault; the machine was brought to a stop, and :meth:`resume` goes on.
        GateRefused
            If a safety gate says no, a path that passes a limit for example.
        StoppedByOperator
            After Ctrl-C, :meth:`stop`, or where the operator said so.
        """
        return self._loop.wait(
            self._station.measure(
                poses,
                order=order,
                reference_every=reference_every,
                cycles=cycles,
                warm_up=warm_up,
                title=title,
                pairs=pairs,
            )
        )

    def resume(self, session: File | None = None) -> SessionReport:
        """Go on where a session was; the latest in ``folder`` if None.

        A verification leaves its verdict as ``verification.json`` in its folder.

        Returns
        -------
        SessionReport

        Raises
        ------
        BadInput
            If there is no session.
        DeviceError, GateRefused, StoppedByOperator
            As :meth:`measure`.
        """
        return self._loop.wait(self._station.resume(session))

    def verify(
        self,
        poses: File | Mapping[str, Pose] | None = None,
        *,
        truth: bool = False,
        reference_every: int = REFERENCE_EVERY,
        before: File | VerificationReport | None = None,
    ) -> VerificationReport:
        """Send the machine over a grid, measure where it goes, and say how far off it is.

        Parameters
        ----------
        poses : path or mapping, optional
            As for :meth:`measure`; 27 nodes with 8 orientations each if None.
        truth : bool
            Also ask a mock for the noise-free truth.
        reference_every : int
            Poses between two looks at the base nests.
        before : path or VerificationReport, optional
            An earlier verification, to stand beside this one.

        Returns
        -------
        VerificationReport
            Errors in um and deg, base frame.

        Raises
        ------
        BadInput, DeviceError, GateRefused, StoppedByOperator
            As :meth:`measure`.
        """
        return self._loop.wait(
            self._station.verify(poses, truth=truth, reference_every=reference_every, before=before)
        )

    def auto(
        self,
        target_um: float | None = None,
        *,
        hours: float | None = None,
        first: int = 15,
        apply: bool = True,
        seed: int = 1,
        out: File | None = None,
        decide: Operator | None = None,
        tell: Callable[[str], None] | None = None,
    ) -> AutoReport:
        """Calibrate until fresh poses show the wanted accuracy, deciding what to do next.

        Measure, find what is missing, measure for what cannot be told apart, write through the
        gates, verify; see docs/auto.md. Every decision is journaled before it is carried out.

        Parameters
        ----------
        target_um : float, optional
            RMS position error at fresh poses that is wanted, um; that of ``out`` if it was begun.
        hours : float, optional
            Machine time for all readings.
        first : int
            Poses to begin with, 6 to 60.
        apply : bool
            Whether what is good enough is written to the machine.
        seed : int
            Draws the candidates for poses.
        out : path, optional
            Folder of the journal; one in which something was begun is gone on with. Without,
            ``auto-<date and time>``.
        decide : callable, optional
            Asked before each decision is carried out, with what and why, and the possible answers:
            ``"go on"``, ``"skip"``, others instead, ``"stop"``; where poses are to be measured also
            how many, ``"20 poses"``. It runs in a thread of its own. Without, all are carried out.
        tell : callable, optional
            Told each decision and what came of it, in a line, in the station's own thread.

        Returns
        -------
        AutoReport
            ``reached``, ``why``, ``decisions``, ``model``, ``runs``.

        Raises
        ------
        BadInput
            Without a target, for a damaged journal, and for an answer of ``decide`` that is none.
        DeviceError, GateRefused
            As :meth:`measure`. What a gate refuses to write ends it with a report that says so.
        StoppedByOperator
            After Ctrl-C, :meth:`stop`, or where ``decide`` said so; with ``out`` it goes on.
        """
        return self._loop.wait(
            self._station.auto(
                target_um, hours=hours, first=first, apply=apply, seed=seed, out=out,
                decide=decide, tell=tell,
            )
        )  # fmt: skip
