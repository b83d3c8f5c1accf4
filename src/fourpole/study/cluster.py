"""Recordings demodulated on a Dask cluster that runs already: its executor; needs the extra `cluster`."""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from importlib import import_module
from typing import Any
from urllib.parse import urlsplit

from fourpole.errors import CampaignError
from fourpole.units import shown
from fourpole.version import VERSION

#: Time within which a scheduler must answer [s].
_ANSWER = 10.0


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of a Dask cluster; its workers read the recordings, so they need the campaign folder too.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as tcp://10.0.0.5:8786.

    Raises
    ------
    CampaignError
        If Dask is not installed, no scheduler answers, it has no worker, or its workers lack Fourpole.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise CampaignError(
            "a cluster needs the libraries dask and distributed, which are not installed; pip install "
            "'fourpole[cluster]'"
        ) from None
    name = shown(address, 100)[1:-1]
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # its errors are raised here
    try:
        parts = urlsplit(address)
        if parts.scheme not in ("tcp", "tls") or not parts.hostname or not parts.port:
            raise ValueError("no address of a scheduler")
        # A client that cannot connect does not always end its own threads.
        socket.create_connection((parts.hostname, parts.port), timeout=_ANSWER).close()
        client = distributed.Client(address, timeout=_ANSWER, set_as_default=False)
    except Exception as error:  # noqa: BLE001 - whatever Dask raises where no scheduler is
        raise CampaignError(
            f"{name}: no Dask scheduler answers there ({type(error).__name__}): check the address, which dask "
            "scheduler prints at its start, as tcp://10.0.0.5:8786"
        ) from None
    try:
        executor: Any = client.get_executor(pure=False)
        executor.count = _threads(client, name)
        yield executor
    finally:
        client.close()


def _threads(client: Any, name: str) -> int:
    """Number of threads of all workers of a cluster, each of which can run the reduction."""
    threads = sum(client.nthreads().values())
    if not threads:
        raise CampaignError(f"{name}: the scheduler has no worker: start some, as dask worker {name} --nthreads 1")
    try:
        others = client.run(version_here)
    except Exception as error:  # noqa: BLE001 - whatever the worker raised
        raise CampaignError(
            f"{name}: a worker cannot load Fourpole ({type(error).__name__}: {error}): install the same version there"
        ) from None
    for worker, version in others.items():
        if version != VERSION:
            raise CampaignError(
                f"{name}: the worker {worker} has Fourpole {version}, and this is {VERSION}: install {VERSION} there"
            )
    return int(threads)


def version_here() -> str:
    """The version of Fourpole where this runs."""
    return VERSION
