"""The file that a child process runs first, before anything but Python's own modules can be imported.

The package is loaded from the folder that the parent loaded it from, whether or not that folder is on the path: a
checkout that is run from its own root has to work without the working folder on the path. The process gives up its
network: nothing that reads a recording needs one.
"""

import ctypes
import gc
import json
import os
import sys
from contextlib import suppress
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

_CLONE_NEWUSER = 0x10000000
_CLONE_NEWNET = 0x40000000


def main() -> int:
    """Run what `launching.start` asks for in `sys.argv[1]`."""
    package, path, module = json.loads(sys.argv.pop(1))
    sys.path[:] = path
    _load_package(package)
    give_up_network()
    code: int = import_module(module).main()
    gc.freeze()  # as the command line does at its end
    return code


def _load_package(folder: str) -> None:
    spec = spec_from_file_location("auditor", f"{folder}/__init__.py", submodule_search_locations=[folder])
    assert spec is not None
    assert spec.loader is not None
    sys.modules["auditor"] = package = module_from_spec(spec)
    spec.loader.exec_module(package)


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


if __name__ == "__main__":
    raise SystemExit(main())
