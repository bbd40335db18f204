"""Many questions of one kind, shared among processes here or the workers of a Dask scheduler.

One interface: :func:`spread` takes a function and what it is asked of, and yields the answers as
they come, each with the number of its question. The function is one of a module (processes import
it), its arguments and answers are records and arrays; what it draws it draws by a seed among its
arguments, so that answers do not hang on who gives them. A process or a worker that dies meanwhile
costs time only: what it was asked is asked again.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, TypeVar

from calib.errors import BadInput

_Question = TypeVar("_Question")
_Answer = TypeVar("_Answer")

DEATHS = 3
"""Processes that may die before the question is taken to kill them."""
CONNECT_S = 10.0


def spread(
    function: Callable[[_Question], _Answer],
    questions: Sequence[_Question],
    *,
    workers: int | None = None,
    scheduler: str = "",
) -> Iterator[tuple[int, _Answer]]:
    """Ask all questions, and yield (number, answer) as they are answered.

    Parameters
    ----------
    function : callable
        Of a module, so that other processes can import it.
    questions : sequence
    workers : int, optional
        Processes here; one for each processor if not given. One asks in this process.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``, in place of processes.

    Raises
    ------
    BadInput
        If the scheduler does not answer, or Dask is not installed; and what ``function`` raises.
    """
    if scheduler:
        return _by_dask(function, questions, scheduler)
    count = min(workers or os.cpu_count() or 1, len(questions))
    if count <= 1:
        return ((number, function(one)) for number, one in enumerate(questions))
    return _by_processes(function, questions, count)


def _by_processes(
    function: Callable[[_Question], _Answer], questions: Sequence[_Question], count: int
) -> Iterator[tuple[int, _Answer]]:
    """Processes here; a pool in which one died is made anew for what it has not answered."""
    left, deaths = set(range(len(questions))), 0
    while left:
        pool = ProcessPoolExecutor(count, get_context("spawn"), _alone)
        try:
            for number, answer in _answers(pool, function, questions, sorted(left)):
                left.discard(number)
                yield number, answer
        except BrokenProcessPool:
            deaths += 1
            if deaths >= DEATHS:
                raise BadInput(
                    f"processes died {deaths} times before they answered",
                    remedy="See whether memory runs out: fewer workers need less",
                ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _answers(
    pool: ProcessPoolExecutor,
    function: Callable[[_Question], _Answer],
    questions: Sequence[_Question],
    numbers: Sequence[int],
) -> Iterator[tuple[int, _Answer]]:
    asked: dict[Future[_Answer], int] = {pool.submit(function, questions[n]): n for n in numbers}
    while asked:
        for done in wait(asked, return_when=FIRST_COMPLETED).done:
            yield asked.pop(done), done.result()


def _alone() -> None:
    """A process among several keeps to one thread: they would fight for the processors."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _by_dask(
    function: Callable[[_Question], _Answer], questions: Sequence[_Question], address: str
) -> Iterator[tuple[int, _Answer]]:
    """Workers of a Dask scheduler; what a lost one was asked goes to another."""
    try:
        from dask import distributed
    except ImportError:
        raise BadInput(
            "Dask is not installed", place="--scheduler", remedy="pip install 'pkmcal[fleet]'"
        ) from None
    try:
        dask: Any = distributed
        client = dask.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise BadInput(
            f"no Dask scheduler answers at {address}: {error}",
            place="--scheduler",
            remedy="Start one (dask scheduler), and workers with pkmcal installed (dask worker)",
        ) from None
    with client:
        asked = client.map(function, list(questions), pure=False)
        numbers = {future.key: number for number, future in enumerate(asked)}
        for future in dask.as_completed(asked, loop=client.loop):
            yield numbers[future.key], future.result()
            future.release()
