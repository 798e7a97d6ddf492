"""Names of a package that are imported when they are first used (PEP 562)."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def imported_when_used(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """The `__getattr__` of a package whose names, by their modules in `homes`, are imported when they are first used.

    `homes` has the same as the package's imports for type checkers: the names of a module, divided by blanks.
    """

    def imported(name: str) -> object:
        for module, names in homes.items():
            if name in names.split():
                found: object = getattr(import_module(f"{package}.{module}"), name)
                setattr(sys.modules[package], name, found)
                return found
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return imported
