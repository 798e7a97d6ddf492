"""Root as other users are: what root alone may do is laid down for a while."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from unittest.mock import patch

_VERSION = 0x20080522
_DAC_OVERRIDE, _DAC_READ_SEARCH, _FOWNER, _CHOWN = 1, 2, 3, 0
_OF_ROOT = sum(1 << one for one in (_DAC_OVERRIDE, _DAC_READ_SEARCH, _FOWNER, _CHOWN))
_LIBC = ctypes.CDLL(None, use_errno=True)


@contextmanager
def without_rights() -> Iterator[None]:
    """Within the block the modes of files hold for root, too, as for every other user; for these nothing changes."""
    if os.geteuid() != 0:
        yield
        return
    before = _capabilities()
    _set([before[0] & ~_OF_ROOT, *before[1:]])
    try:
        with patch("os.access", partial(os.access, effective_ids=True)):  # as it is, it asks for what root might do
            yield
    finally:
        _set(before)


def _capabilities() -> list[int]:
    """The capabilities of this thread: effective, permitted and inheritable ones, first the lower 32 and then more."""
    values = (ctypes.c_uint32 * 6)()
    assert _LIBC.capget((ctypes.c_uint32 * 2)(_VERSION, 0), values) == 0
    return list(values)


def _set(values: list[int]) -> None:
    assert _LIBC.capset((ctypes.c_uint32 * 2)(_VERSION, 0), (ctypes.c_uint32 * 6)(*values)) == 0
