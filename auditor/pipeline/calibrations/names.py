"""Calibrations by what people call them: a file, an id, or the beginning of one."""

import shlex
from pathlib import Path

from auditor.errors import ThresholdsError
from auditor.model.calibration import Calibration
from auditor.store import Store, read_calibration


def named_calibration(folder: Path, name: str | None) -> Calibration | None:
    """The calibration of a name: a file, or an id of the store in a folder or the beginning of one; None of None.

    Raises ThresholdsError where there is none, also where there is no store yet.
    """
    if name is None:
        return None
    if Path(name).is_file():
        return read_calibration(Path(name))
    if not Store.is_at(folder):
        raise _no_calibration(name, folder, known=False)
    store = Store.open(folder)
    return store.calibration(calibration_called(store, name))


def calibration_called(store: Store, beginning: str) -> str:
    """The id of the one calibration that begins so. Raises ThresholdsError where there is none, or several."""
    matching = store.calibrations_called(beginning)
    if len(matching) != 1:
        raise _no_calibration(beginning, store.folder, known=bool(store.ids("calibrations")), several=bool(matching))
    return matching[0]


def _no_calibration(name: str, folder: Path, *, known: bool, several: bool = False) -> ThresholdsError:
    what = "several calibrations begin so" if several else "no calibration has that id, and no file that name"
    remedy = listing_calibrations(folder) if known else "the store has none yet: make one with auditor calibrate"
    return ThresholdsError(what, where=name or "--calibration", remedy=remedy)


def listing_calibrations(folder: Path) -> str:
    """A command that lists the calibrations of a store."""
    return f"auditor calibration list --store {shlex.quote(str(folder))} lists them"
