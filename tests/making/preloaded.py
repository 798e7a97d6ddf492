"""Processes of recordings that are forked with torch: to import it takes each of them a second."""

from collections.abc import Iterator
from contextlib import contextmanager

from auditor.pipeline import fork_server

NETWORK = "auditor.measurement.disparity.matchers.psmnet.matcher"


@contextmanager
def network_preloaded() -> Iterator[None]:
    """Inside, processes are forked from one that has imported the network."""
    fork_server._SERVERS.close()
    fork_server._PRELOADED.append(NETWORK)
    try:
        yield
    finally:
        fork_server._PRELOADED.remove(NETWORK)
        fork_server._SERVERS.close()
