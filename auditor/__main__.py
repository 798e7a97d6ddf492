"""Entry point of `auditor` and `python -m auditor`."""

import gc
import io
import os
import site
import sys

_COLLECTED_AFTER = 50_000
"""Objects: of what verbs import hardly any goes again, and Python's 700 take a tenth of what a small scan takes."""


def main() -> None:
    """Run the command line; imports sit inside the verbs so that `--help` is quick."""
    _leave_working_folder()
    gc.set_threshold(_COLLECTED_AFTER)
    from auditor.cli import run  # noqa: PLC0415

    if isinstance(sys.stdout, io.TextIOWrapper):  # what a terminal of another encoding cannot show is written out
        sys.stdout.reconfigure(errors="backslashreplace")
    code = run()
    gc.freeze()  # what is left is not searched once more for what nothing refers to: 0.05 CPU s
    sys.exit(code)


def _leave_working_folder() -> None:
    """Import nothing from the working folder from here on: it may hold logs of strangers.

    `python -m` and empty entries of PYTHONPATH put it on the path. The package is found where it was loaded from.
    """
    try:
        working = os.path.realpath(os.getcwd())  # noqa: PTH109 - pathlib would be imported from that folder
    except FileNotFoundError:  # a folder that was removed has no modules
        return
    library = os.path.dirname(os.__file__)  # noqa: PTH120
    installed = (library, f"{library}/lib-dynload", *site.getsitepackages(), site.getusersitepackages())
    if working not in map(os.path.realpath, installed):
        sys.path[:] = [folder for folder in sys.path if os.path.realpath(folder) != working]


if __name__ == "__main__":
    main()
