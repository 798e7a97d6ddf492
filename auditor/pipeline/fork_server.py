"""Processes that are forked from one that has imported everything and used nothing.

OpenCV's and Arrow's threads do not survive a fork once they run; a fresh interpreter for each task would import for a
second. The server has one thread and answers one request at a time: it forks, or takes in a process that has ended.
Only the server may do that, so a process keeps its number until whoever started it asks for the exit code.
"""

import atexit
import ctypes
import gc
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from typing import Any

from auditor.safety.launching import import_path, start

_PRELOADED = ["auditor.pipeline.warm"]
_MODULE = "auditor.pipeline.fork_server"
_FORK, _TAKE_IN = b"f", b"t"
_NUMBER_BYTES = 8
_PR_SET_PDEATHSIG = 1


class _Server:
    """This process's end of the fork server."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair()
        # Ctrl-C is for this process, which stops the workers; server and workers inherit that it is blocked.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with theirs:
                self._process = start(_MODULE, str(theirs.fileno()), *_PRELOADED, handed_on=[theirs.fileno()])
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    @property
    def runs(self) -> bool:
        """Whether it can fork."""
        return self._process.poll() is None

    def fork(self, pipe: int) -> int:
        """The number of a new process that has this descriptor, and this process's working folder. Raises OSError."""
        folder = os.open(".", os.O_PATH | os.O_DIRECTORY)
        try:
            socket.send_fds(self._socket, [_FORK], [pipe, folder])
        finally:
            os.close(folder)
        return self._number()

    def take_in(self, pid: int) -> int:
        """Wait for a process to end; returns its exit code, negative for a signal. Raises OSError."""
        self._socket.sendall(_TAKE_IN + _packed(pid))
        return self._number()

    def _number(self) -> int:
        answer = _received(self._socket)
        if not answer:
            raise ConnectionResetError("the process that forks workers has ended")
        return int.from_bytes(answer, "little", signed=True)

    def close(self) -> None:
        """End it, and with it all processes that it forked."""
        self._socket.close()
        self._process.kill()  # it has nothing to lose, and would take its time to end by itself
        self._process.wait()


class _Servers:
    """The server of this process, started when it is first needed and again where it has died."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._server: _Server | None = None

    def running(self) -> _Server:
        if self._server is None:
            atexit.register(self.close)
        elif not self._server.runs:
            self.close()
        if self._server is None:
            self._server = _Server()
        return self._server

    def close(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            server.close()


_SERVERS = _Servers()


@dataclass(eq=False)
class Worker:
    """A forked process and the pipe to it; where the process dies, the pipe ends."""

    pid: int
    pipe: "Connection[Any, Any]"
    _server: _Server
    _code: int | None = None

    def kill(self) -> None:
        """Kill it, unless its exit code is known: its number may be another process's by then."""
        if self._code is None:
            with suppress(ProcessLookupError):  # where its server has died, the system has taken it in
                os.kill(self.pid, signal.SIGKILL)

    def exit_code(self) -> int:
        """Wait for its end; the code is negative for the signal that ended it."""
        if self._code is None:
            try:
                with _SERVERS.lock:
                    self._code = self._server.take_in(self.pid)
            except OSError:
                self._code = -signal.SIGKILL  # workers are killed with their server
        return self._code


def fork(work: Callable[..., None], *arguments: object) -> Worker:
    """Call `work(pipe, *arguments)` in a forked process; all must be such as can be pickled.

    Raises OSError where no process can be started.
    """
    ours, theirs = Pipe()
    with closing(theirs), _SERVERS.lock:  # the process has the only other end
        server = _SERVERS.running()
        pid = server.fork(theirs.fileno())
    worker = Worker(pid, ours, server)
    with suppress(OSError):  # it has died: whoever reads the pipe sees its end
        ours.send(import_path())
        ours.send((work, arguments))
    return worker


def main() -> int:
    """Serve, in the server's process; each forked process returns from here, too."""
    _, number, *preloaded = sys.argv
    requests = socket.socket(fileno=int(number))
    gc.disable()  # what is imported stays: to look through it again and again takes a seventh of importing it
    for module in preloaded:
        import_module(module)
    gc.freeze()  # nor do the forked processes look through it
    gc.enable()
    while True:
        request, descriptors, *_ = socket.recv_fds(requests, 1, 2)
        if not request:  # the process that asks has ended
            return 0
        if request == _TAKE_IN:
            _, status = os.waitpid(int.from_bytes(_received(requests), "little", signed=True), 0)
            requests.sendall(_packed(os.waitstatus_to_exitcode(status)))
            continue
        pid = os.fork()
        if pid == 0:
            requests.close()
            _work(*descriptors)
            return 0
        for descriptor in descriptors:
            os.close(descriptor)
        requests.sendall(_packed(pid))


def _work(pipe: int, folder: int) -> None:
    """Do what is sent through the pipe, in the working folder of whoever sent it."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    os.fchdir(folder)
    os.close(folder)
    connection: Connection[Any, Any] = Connection(pipe)
    sys.path[:] = connection.recv()
    work, arguments = connection.recv()
    work(connection, *arguments)


def _packed(number: int) -> bytes:
    return number.to_bytes(_NUMBER_BYTES, "little", signed=True)


def _received(source: socket.socket) -> bytes:
    """One number; nothing where the other end is closed."""
    return source.recv(_NUMBER_BYTES, socket.MSG_WAITALL)
