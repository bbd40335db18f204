"""What a station's controller holds, for scripts: compare, write, bring back, take as known."""

from collections.abc import Mapping

from app.jobs.applying import AcceptReport, ApplyReport, SetsReport, UndoReport
from app.jobs.chosen_runs import File
from pkmcal.async_station import AsyncStation
from pkmcal.own_loop import OwnLoop


class ParameterSets:
    """The part of :class:`pkmcal.Station` that deals with parameter sets."""

    _station: AsyncStation
    _loop: OwnLoop

    def propose(self, fit: File, *, limits: Mapping[str, float] | None = None) -> ApplyReport:
        """Compare a saved fit with the controller and ask the gates; nothing is written.

        Parameters
        ----------
        fit : path
            A model file (``found.save(...)``).
        limits : mapping, optional
            Other limits of gates, by name.

        Returns
        -------
        ApplyReport
            ``written`` is False.

        Raises
        ------
        BadInput
            If the fit cannot be read or is of another machine.
        GateRefused
            Naming every gate that did not pass.
        DeviceError
            If the controller does not hold what is known of it.
        """
        return self._loop.wait(self._station.propose(fit, limits=limits))

    def apply(
        self, fit: File, *, yes: bool = False, limits: Mapping[str, float] | None = None
    ) -> ApplyReport:
        """Write a saved fit to the controller: gates, trial, check poses, and only then keep.

        A snapshot is taken first. Any failure brings it back.

        Parameters
        ----------
        fit : path
            A model file (``found.save(...)``).
        yes : bool
            Keep what passes every gate. If False the operator is asked, ("keep", "put back").
        limits : mapping, optional
            Other limits of gates, by name, knowingly.

        Returns
        -------
        ApplyReport
            ``snapshot`` is what :meth:`undo` takes.

        Raises
        ------
        BadInput
            If the fit cannot be read, or neither ``yes`` nor an operator is there.
        GateRefused
            If a gate or the operator said no; the earlier set is back.
        DeviceError
            If something broke; the message says whether the earlier set is back.
        StoppedByOperator
            If the operator stopped; the earlier set is back.
        """
        return self._loop.wait(self._station.apply(fit, yes=yes, limits=limits))

    def undo(self, to: int | None = None) -> UndoReport:
        """Bring a parameter set back to the controller, for good.

        Parameters
        ----------
        to : int, optional
            Its number; the one before the last :meth:`apply` if None.

        Returns
        -------
        UndoReport

        Raises
        ------
        BadInput
            If there is no such set.
        DeviceError
            If it does not read back: the parameters are then unknown, and motion is blocked.
        """
        return self._loop.wait(self._station.undo(to))

    def accept(self) -> AcceptReport:
        """Take what the controller holds as known; nothing is written.

        Returns
        -------
        AcceptReport

        Raises
        ------
        DeviceError
            If its parameters cannot be read.
        """
        return self._loop.wait(self._station.accept())

    def sets(self) -> SetsReport:
        """The parameter sets of this controller that this program knows of.

        Returns
        -------
        SetsReport

        Raises
        ------
        DeviceError
            If the controller does not answer.
        """
        return self._loop.wait(self._station.sets())
