"""Sequences of PandaSet, recognised and not read: their clouds are pickled, and opening a pickle runs code."""

from pathlib import Path

from auditor.errors import RecordingError
from auditor.recordings.recording import Recording


class PandaSetReader:
    """Recognises a sequence's folder (scaleapi/pandaset-devkit: lidar/NN.pkl.gz beside camera/NAME)."""

    def detects(self, path: Path) -> bool:
        """True for a folder with pickled clouds and cameras."""
        return (path / "camera").is_dir() and any((path / "lidar").glob("*.pkl*"))

    def open(self, path: Path) -> Recording:
        """Raises RecordingError: it is not read."""
        raise RecordingError(
            "PandaSet's clouds are pickles, which can run code when they are opened: they are not read",
            where=path,
            remedy="convert it with PandaSet's own devkit, where you trust the files, to MCAP",
        )
