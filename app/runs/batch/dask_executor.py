"""A crew that is a Dask cluster, on this computer or on many that see the same run files."""

import importlib
import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from app.runs.errors import ClusterError, ExtraMissingError
from app.version import __version__

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_PATIENCE_S = 5.0


class DaskExecutor:
    """The workers of a Dask cluster.

    Parameters
    ----------
    address : str
        Of the scheduler, for example `tcp://lab-server:8786`.

    Raises
    ------
    ExtraMissingError
        Dask's `distributed` is not installed.
    ClusterError
        No cluster answers there, it has no workers, or they have not this version of Slipstand.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._client = _connected(address)
        try:
            self._check_workers()
            self._executor: Any = self._client.get_executor(pure=False)
        except BaseException:
            self._client.close()
            raise

    @property
    def workers(self) -> int:
        """How many pieces of work are done at once, as the cluster stands now."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over a piece of work; where a worker dies, Dask has another one do it again."""
        future: Future[Answer] = self._executor.submit(work, item)
        return future

    def renew(self) -> None:
        """The cluster looks after its workers itself."""

    def close(self, *, now: bool) -> None:
        """Leave the cluster; what is still waiting there is given up."""
        self._executor.shutdown(wait=not now)
        self._client.close()

    def _check_workers(self) -> None:
        try:
            versions: dict[str, str] = self._client.run(program_version)
        except Exception as error:
            words = " ".join(str(error).split())[:120]
            raise ClusterError(
                "the workers of {address} cannot run Slipstand ({name}: {words}). Install it"
                " there, in the same version",
                address=self._address,
                name=type(error).__name__,
                words=words,
            ) from None
        if not versions:
            raise ClusterError(
                "the cluster at {address} has no workers. Start some: dask worker {address}",
                address=self._address,
            )
        for worker, version in versions.items():
            if version != __version__:
                raise ClusterError(
                    "worker {worker} has Slipstand {version}, here it is {version_2}. Install"
                    " the same version on both",
                    worker=worker,
                    version=version,
                    version_2=__version__,
                )


def program_version() -> str:
    """Version of Slipstand where this is called."""
    return __version__


def _connected(address: str) -> Any:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise ExtraMissingError(
            "--dask needs Dask's distributed, which is not installed. Install it:"
            " pip install 'slipstand[cluster]'"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is told by its outcome
    try:
        distributed.comm.get_address_host_port(address)  # a client takes 20 s to see it
        return distributed.Client(address, timeout=_PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        words = " ".join(str(error).split())[:120]
        raise ClusterError(
            "no Dask scheduler answers at {address!r} ({value}). Start one with `dask"
            " scheduler`, and give its address, for example tcp://localhost:8786",
            address=address,
            value=words or type(error).__name__,
        ) from None
