"""A process without a network: nothing that reads a recording needs one."""

import ctypes
import os
from contextlib import suppress
from pathlib import Path

_CLONE_NEWUSER = 0x10000000
_CLONE_NEWNET = 0x40000000


def give_up_network() -> None:
    """Move this process, which may have no threads yet, into a network namespace that has no interface up.

    Root needs no user namespace for it, and would lose rights in one. Where the system refuses, the process keeps its
    network: many containers allow no namespaces, and audits have to run there.
    """
    user, group = os.geteuid(), os.getegid()
    alone = _CLONE_NEWNET if user == 0 else _CLONE_NEWNET | _CLONE_NEWUSER
    if ctypes.CDLL(None, use_errno=True).unshare(alone) == 0 and user != 0:
        _keep_ids(user, group)


def _keep_ids(user: int, group: int) -> None:
    """Keep the numbers of user and group, by which files are checked: else they would read as `nobody`."""
    for name, content in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
        with suppress(OSError):  # a system that gives a namespace without rights in it
            Path(f"/proc/self/{name}").write_text(content, encoding="ascii")
