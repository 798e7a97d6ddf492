"""Where a command may write: an existing file is kept, unless the same command made it."""

from pathlib import Path

from auditor.errors import AuditorError, SettingError

_PAGE_MARK = b'<meta name="generator" content="auditor '
_PAGE_HEAD_BYTES = 4096


def check_new(target: Path) -> None:
    """Raises SettingError where there is something already."""
    if target.exists():
        raise SettingError("it exists already", where=target, remedy="choose another name, or remove it")


def check_page(target: Path) -> None:
    """Raises SettingError where there is something else than a page that auditor wrote."""
    if target.exists() and not _is_page(target):
        raise _foreign(target, "not a page that auditor wrote")


def check_pages(folder: Path) -> None:
    """Raises SettingError where the pages of a folder would take the place of something else."""
    if folder.exists() and not folder.is_dir():
        raise SettingError("it is a file", where=folder, remedy="name a folder, or a file that ends in .html")
    for page in (folder / "index.html", *sorted(folder.glob("incidents/*.html"))):
        check_page(page)


def check_thresholds(target: Path) -> None:
    """Raises SettingError where there is something else than a thresholds artefact."""
    if target.exists() and not _is_thresholds(target):
        raise _foreign(target, "not a thresholds artefact")


def _foreign(target: Path, contents: str) -> SettingError:
    there = "a folder" if target.is_dir() else contents
    return SettingError(
        f"it exists already and is {there}", where=target, remedy="name another file with --out; nothing was written"
    )


def _is_page(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return _PAGE_MARK in file.read(_PAGE_HEAD_BYTES)
    except OSError:
        return False


def _is_thresholds(path: Path) -> bool:
    from auditor.store.calibrations import OutdatedCalibrationError, read_calibration  # noqa: PLC0415 - heavy

    try:
        read_calibration(path)
    except OutdatedCalibrationError:
        return True
    except AuditorError:
        return False
    return True
