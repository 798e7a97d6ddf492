"""The results of measuring and judging, kept so that a later version can be compared with it byte for byte.

    python -m tests.benchmarks.golden_store make FOLDER
    python -m tests.benchmarks.golden_store compare FOLDER

`make` audits with the code as it stands, by both methods: the demo and faults in one of its recordings, drives 0009 and
0001 (each judged by calibrations from both), and a small recording with nanosecond stamps and attacks. Of every
recording it writes the rows of TABLES as `<table>/<recording>.arrow`, without ids, and `SHA256SUMS` for `sha256sum -c`.
`compare` audits anew, lists what differs from FOLDER and exits with 1 where anything does. Names that changed since are
listed in `golden_rows`. Needs AUDITOR_TEST_DATA.
"""

import argparse
import hashlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from tests.benchmarks.golden_rows import RENAMED_TABLES, canonical, differences
from tests.benchmarks.real_drives import drive
from tests.making.small_drives import write_drive

TABLES = ("frames", "cells", "fault_features", "regions", "verdicts")
"""Each has a file a measurement, or a judgement, and a column `frame`."""

START_NS = 1_317_042_145_964_389_445
METHODS = ("robust", "paper")
FAULTS = {"frozen": "S_2", "delayed": "S_2", "soiled": "S_2", "turned": "S_0", "rain": "S_0"}
"""What happens to which sensor of one of the demo's recordings, beside the attacks that the demo makes itself."""

RAN = (0, 1, 3, 4)
"""Exit codes of a command that could do its work, whatever it found."""

Golden = dict[str, bytes]
"""The content of files by their place in the folder."""


def main() -> int:
    """Make a golden store, or compare with one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("make", "compare"))
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    if options.verb == "make":
        keep(audit_all(), options.folder)
        return 0
    kept, now = read(options.folder), audit_all()
    found = list(compare(kept, now))
    print("\n".join(found) or f"{len(now)} files, {sum(map(len, now.values()))} bytes: all equal")
    return int(bool(found))


def keep(golden: Golden, folder: Path) -> None:
    """Write the files and their sums."""
    for place, content in golden.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_bytes(content)
    sums = (f"{hashlib.sha256(content).hexdigest()}  {place}\n" for place, content in golden.items())
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")


def read(folder: Path) -> Golden:
    """The files of a golden store, in today's names."""
    return {
        f"{RENAMED_TABLES.get(path.parent.name, path.parent.name)}/{path.name}": canonical(_table(path.read_bytes()))
        for path in sorted(folder.glob("*/*.arrow"))
    }


def compare(kept: Golden, now: Golden) -> Iterator[str]:
    """One line for each file, or column of a file, that is not the same."""
    for place in sorted({*kept, *now}):
        if place not in kept or place not in now:
            yield f"{place}: only {'made now' if place in now else 'in the golden store'}"
        elif kept[place] != now[place]:
            yield from (f"{place}: {what}" for what in differences(_table(kept[place]), _table(now[place])))


def _table(content: bytes) -> pa.Table:
    return pa.ipc.open_file(content).read_all()


def audit_all() -> Golden:
    """Audit everything with the code as it stands."""
    with TemporaryDirectory() as folder:
        stores = (_demo(Path(folder)), _real_drives(Path(folder)), _nanoseconds(Path(folder)))
        return {place: content for store in stores for place, content in sorted(_contents(store))}


def _demo(folder: Path) -> Path:
    demo, store = folder / "demo", folder / "demo" / "audit"
    _auditor("demo", demo)
    for kind, sensor in FAULTS.items():
        during = ("--from", 0.4, "--to", 1.1)
        _auditor("attack", demo / "alder_evening.mcap", demo / f"{kind}.mcap", "--on", sensor, "--kind", kind, *during)
    _auditor("scan", *(demo / f"{kind}.mcap" for kind in FAULTS), "--store", store)
    _auditor("judge", store, "--method", "paper")
    return store


def _real_drives(folder: Path) -> Path:
    store, drives = folder / "real", ("0009", "0001")
    for number in drives:
        _auditor("calibrate", drive(number), "--store", store, "--out", folder / number)
    for number in drives:
        for method in METHODS:
            _auditor("judge", store, "--calibration", folder / number, "--method", method)
    return store


def _nanoseconds(folder: Path) -> Path:
    store, clean, spoilt = (folder / name for name in ("nanoseconds", "ns_clean.mcap", "ns_attacked.mcap"))
    write_drive(clean, seed=1, start_ns=START_NS)
    write_drive(spoilt, seed=1, start_ns=START_NS + 60 * 10**9, attacked={2: range(4, 10), 0: range(13, 18)})
    _auditor("calibrate", clean, "--store", store)
    _auditor("scan", spoilt, "--store", store)
    _auditor("judge", store, "--method", "paper")
    return store


def _auditor(*words: object) -> None:
    command = [sys.executable, "-m", "auditor", *map(str, words)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode not in RAN:
        raise SystemExit(f"{' '.join(command)} exited with {ran.returncode}:\n{ran.stderr}")


def _contents(store: Path) -> Iterator[tuple[str, bytes]]:
    """The files of TABLES in a store, each by its place in a golden store."""
    names = _names(store)
    for table in TABLES:
        for path in (store / table).glob("*.parquet"):
            yield f"{table}/{names[path.stem]}.arrow", canonical(pq.read_table(path))


def _names(store: Path) -> dict[str, str]:
    """By their ids: measurements are called as their recordings, judgements also by their method and calibration."""
    recordings, measurements, judgements, calibrations = (
        [row for path in (store / table).glob("*.parquet") for row in pq.read_table(path).to_pylist()]
        for table in ("recordings", "measurements", "judgements", "calibrations")
    )
    called = {row["recording_id"]: row["name"] for row in recordings}
    made_of = {row["calibration_id"]: row["recordings"] or () for row in calibrations}
    learnt = {known: "+".join(sorted(called[one] for one in recordings)) for known, recordings in made_of.items()}
    names = {row["measurement_id"]: called[row["recording_id"]] for row in measurements}
    for row in judgements:
        names[row["judgement_id"]] = "--".join(
            (names[row["measurement_id"]], row["method"], learnt[row["calibration_id"]])
        )
    if len({*names.values()}) != len(names):
        raise ValueError(f"{store}: two measurements or judgements have one name")
    return names


if __name__ == "__main__":
    sys.exit(main())
