"""Every error that `auditor` raises on purpose.

    AuditorError
    ├── RecordingError       a recording that cannot be read at all
    ├── DecodingError        one message that cannot be decoded: counted as damaged, never ends a recording
    ├── RigError             no rig could be found, or a rig that does not fit its recording
    ├── ThresholdsError      no thresholds, or thresholds of another rig kind, matcher or setting
    ├── StoreError           a store that cannot be read or written
    ├── QueryError           a query that does not exist, lacks a parameter, or is not allowed
    ├── LimitError           a task that took more memory or time than it may
    └── SettingError         an option whose value makes no sense

Each carries what happened, where, and what to do about it, and prints as one line.
"""

import errno
from collections.abc import Iterator
from contextlib import contextmanager


class AuditorError(Exception):
    """What went wrong, where it went wrong, and what the user can do: `where: what; remedy`."""

    def __init__(self, what: str, *, where: object = "", remedy: str = "") -> None:
        self.what = what
        self.where = _place(where)
        self.remedy = remedy
        super().__init__(what, self.where, remedy)

    def __str__(self) -> str:
        prefix = f"{self.where}: " if self.where else ""
        suffix = f"; {self.remedy}" if self.remedy else ""
        return f"{prefix}{self.what}{suffix}"

    def located(self, where: object) -> "AuditorError":
        """The same error; where it did not know its place, with this one."""
        return self if self.where else _rebuild(type(self), self.what, where, self.remedy)

    def __reduce__(self) -> tuple[object, ...]:
        # Errors cross process borders; keyword-only arguments need their own pickling.
        return (_rebuild, (type(self), self.what, self.where, self.remedy))


def _place(where: object) -> str:
    """The text of a place; none of a thing without a text of its own, of which Python shows an address in memory."""
    own = type(where).__str__ is not object.__str__ or type(where).__repr__ is not object.__repr__
    return str(where) if own else ""


def _rebuild(kind: type[AuditorError], what: str, where: object, remedy: str) -> AuditorError:
    # A kind may ask for other arguments than these, also one of a plug-in: its own __init__ is not called.
    error = kind.__new__(kind)
    AuditorError.__init__(error, what, where=where, remedy=remedy)
    return error


class RecordingError(AuditorError):
    """A recording that cannot be read at all."""


class DecodingError(AuditorError):
    """One message that cannot be decoded; it is counted as damaged and the recording goes on."""


class RigError(AuditorError):
    """No rig in a recording, or a rig that does not fit it."""


class ThresholdsError(AuditorError):
    """No thresholds, or thresholds that were calibrated for something else."""


class NothingMeasuredError(ThresholdsError):
    """No frame in which anything was compared to calibrate on."""


class StoreError(AuditorError):
    """A store that cannot be read or written."""


class QueryError(AuditorError):
    """A query that does not exist, lacks a parameter or is not allowed."""


class LimitError(AuditorError):
    """A task that took more memory or time than it may, and was ended."""


class SettingError(AuditorError):
    """An option whose value makes no sense."""


def refused(error: OSError) -> str:
    """What to do where the system lets this user not read or write a place; empty where something else is wrong."""
    if error.errno == errno.EROFS:
        return "this file system can only be read: name another place, or work on a copy"
    if error.errno in {errno.EACCES, errno.EPERM}:
        return "ask its owner for the right to it (chmod, chown), or name another place"
    return ""


@contextmanager
def needing(what_needs: str, extra: str, where: str = "") -> Iterator[None]:
    """A block that imports packages of an extra: `what_needs` them. Raises SettingError where one is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        remedy = f"pip install 'auditor[{extra}]'"
        raise SettingError(f"{what_needs} the package {error.name}", where=where, remedy=remedy) from error
