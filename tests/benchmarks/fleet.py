"""What verbs cost in a store of many recordings: `python -m tests.benchmarks.fleet --recordings 100 200 400`.

The recordings repeat two that were measured, an attacked one every twentieth time, under new ids and stamps. Prints the
CPU seconds and peak memory of each verb, by the number of recordings, in a process of its own. `--times 10` writes the
packs of the last store ten times, which is far quicker than ten times as many recordings.
"""

import argparse
import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet as pq

from auditor.store.files import make_folder, write_whole
from auditor.store.log.entry import OutputFile, output_of
from auditor.store.log.runs import logged
from auditor.store.packs.index import INDEX, MEMBERS, Index, members_of, pack_path
from auditor.store.packs.packing import LEVEL
from auditor.store.records import judgement_id
from auditor.store.schema import SCHEMA_VERSION, table_schema
from auditor.store.store import Store
from auditor.store.tables import read_table
from tests.store.kept import unpack

ATTACKED_EVERY = 20
OF_FRAMES = ("cells", "fault_features", "regions", "poses", "frames")
_DAY_NS = 24 * 3600 * 10**9
_APART_NS = 1000 * 10**9
_PR_SET_CHILD_SUBREAPER = 36


@dataclass(frozen=True)
class Measured:
    """All rows of one recording that was measured and judged, by table."""

    tables: Mapping[str, pa.Table]
    frames: int
    period_ns: int


def measured_in(folder: Path) -> list[Measured]:
    """A clean and an attacked recording of the kept store, each with its latest judgement by the robust method."""
    store = Store.open(unpack(SCHEMA_VERSION, folder)[0])
    by_name = {store.recording(one.recording_id).name: one.measurement_id for one in store.measurements()}
    return [_measured(store, by_name[name]) for name in ("clean.mcap", "attacked.mcap")]


def _measured(store: Store, known: str) -> Measured:
    measurement = store.measurement(known)
    judgement = next(one for one in reversed(store.judgements()) if one.measurement_id == known)
    ids = {
        "recordings": measurement.recording_id,
        "measurements": known,
        **dict.fromkeys(OF_FRAMES, known),
        "verdicts": judgement.judgement_id,
        "judgements": judgement.judgement_id,
    }
    tables = {table: read_table(table, store.path(table, row_id)) for table, row_id in ids.items()}
    stamps = np.diff(tables["frames"]["stamp_ns"].to_numpy())
    return Measured(tables, measurement.frames, int(np.median(stamps)))


def fill(folder: Path, recordings: int, frames: int, tables: Sequence[str], first: int = 0) -> None:
    """Add recordings of so many frames to the store in a folder, made there where there is none; some tables only."""
    with tempfile.TemporaryDirectory() as place:
        kept = unpack(SCHEMA_VERSION, Path(place))[0]
        known = measured_in(Path(place))
        store, old = Store.open(folder, create=True), Store.open(kept)
        with logged(store.folder) as entry:
            for table in ("rigs", "triples", "sensor_checks", "calibrations", "calibration_history"):
                for path in old.finished_paths(table):
                    _write(store, table, path.stem, read_table(table, path), entry)
            for number in range(first, first + recordings):
                _add(store, number, frames, known[number % ATTACKED_EVERY == ATTACKED_EVERY - 1], set(tables), entry)


def _add(store: Store, number: int, frames: int, one: Measured, tables: set[str], entry: Any) -> None:
    def named(what: str, digits: int) -> str:
        return sha256(f"{what} {number}".encode()).hexdigest()[:digits]

    shift_ns = number * _APART_NS
    before = one.tables["judgements"].to_pylist()[0]
    measured = named("measurement", 32)
    same = (before[name] for name in ("calibration_id", "method", "incidents_per_hour", "r", "rules"))
    how = {name: before[name] for name in ("judging_version", "transferred", "recounted")}
    ids = {
        "recording_id": named("recording", 64),
        "measurement_id": measured,
        "judgement_id": _judgement_id(measured, *same, **how),
    }
    length_ns = frames * one.period_ns
    outputs = {}
    for table in (*OF_FRAMES, "verdicts"):
        content = _repeated(one.tables[table], frames, one, shift_ns)
        content = _renamed(content, ids).slice(0, None if table in tables else 0)
        row_id = ids["judgement_id" if table == "verdicts" else "measurement_id"]
        outputs[table] = _write(store, table, row_id, content, None)
    measurement = {
        "frames": frames,
        "measured": frames,
        "skipped": [],
        "outputs": [outputs[table].fields for table in OF_FRAMES],
    }
    first_ns = one.tables["measurements"]["first_stamp_ns"][0].as_py() + shift_ns
    span = {"first_stamp_ns": first_ns, "last_stamp_ns": first_ns + length_ns}
    row = {**one.tables["measurements"].to_pylist()[0], **measurement, **span, **_of(ids, "measurements")}
    _write_row(store, "measurements", ids["measurement_id"], row, entry)
    counts = ("clean", "attacked", "unidentified", "suspect", "not_auditable", "in_incidents")
    times = frames // one.frames
    row = {**before, **{name: before[name] * times for name in counts}, "outputs": [outputs["verdicts"].fields]}
    _write_row(store, "judgements", ids["judgement_id"], {**row, **_of(ids, "judgements")}, entry)
    name = f"drive_{number:05}.mcap"
    row = one.tables["recordings"].to_pylist()[0] | {"name": name, "path": f"/logs/{name}", "sightings": None}
    row |= {"from_ns": first_ns, "to_ns": first_ns + length_ns, "vehicle": f"car{number % 20}", "conflicts": []}
    _write_row(store, "recordings", ids["recording_id"], {**row, **_of(ids, "recordings")}, entry)


def _judgement_id(
    measured: str, calibration: str, method: str, incidents_per_hour: float | None, r: Decimal, rules: str, **how: Any
) -> str:
    """The id that a judgement by the robust method has: a scan keeps its verdicts, where nothing has changed."""
    return judgement_id(measured, calibration, method, incidents_per_hour, r, rules, **how)


def _of(ids: Mapping[str, str], table: str) -> dict[str, str]:
    names = table_schema(table).arrow.names
    return {name: value for name, value in ids.items() if name in names}


def _repeated(content: pa.Table, frames: int, one: Measured, shift_ns: int) -> pa.Table:
    """Rows of frames, repeated until there are so many frames."""
    times = frames // one.frames
    place = np.tile(np.arange(len(content)), times)
    again = np.repeat(np.arange(times), len(content))
    found = content.take(place)
    for name, step in (("frame", one.frames), ("stamp_ns", one.frames * one.period_ns)):
        if name in found.column_names:
            shifted = found[name].to_numpy() + again * step + (shift_ns if name == "stamp_ns" else 0)
            found = found.set_column(found.column_names.index(name), found.field(name), pa.array(shifted))
    return found


def _renamed(content: pa.Table, ids: Mapping[str, str]) -> pa.Table:
    for name, value in ids.items():
        if name in content.column_names:
            column = pa.repeat(pa.scalar(value, content.field(name).type), len(content))
            content = content.set_column(content.column_names.index(name), content.field(name), column)
    return content


def _write_row(store: Store, table: str, row_id: str, row: Mapping[str, Any], entry: Any) -> None:
    _write(store, table, row_id, pa.Table.from_pylist([dict(row)], schema=table_schema(table).arrow), entry)


def _write(store: Store, table: str, row_id: str, content: pa.Table, entry: Any) -> OutputFile:
    """As the store writes it, but for making it survive a power cut."""
    schema, path = table_schema(table), store.path(table, row_id)
    make_folder(path.parent)
    pq.write_table(
        content.replace_schema_metadata(schema.arrow.metadata),
        path,
        compression="zstd",
        use_dictionary=schema.dictionary_columns,
        column_encoding=schema.encodings,
    )
    output = output_of(path, store.folder)
    if entry is not None:
        with entry.writing([output]):
            pass
    return output


def multiply(folder: Path, times: int) -> None:
    """Write each pack of a store again under other ids, names and stamps until there are so many of it.

    The rows of the copies name no files that they finish.
    """
    store = Store.open(folder)
    index = store.packs.index
    shift_ns = len(store.ids("recordings")) * _APART_NS
    packs = {}
    with logged(store.folder) as entry:
        for table, names in index.packs.items():
            places = [(name, again) for name in names for again in range(1, times)]
            copies = [_copy(folder, table, name, again, again * shift_ns) for name, again in places]
            with entry.writing([output_of(path, store.folder) for path in copies]):
                packs[table] = (*names, *(path.stem for path in copies))
        write_whole(store.folder / INDEX, Index(packs).content, entry.announce)


def _copy(folder: Path, table: str, name: str, again: int, shift_ns: int) -> Path:
    """Write a pack again, row group by row group."""
    schema, source = table_schema(table), pack_path(folder, table, name)
    listed = [list(vars(one).values()) for one in members_of(source).values()]
    members = json.dumps([[_other(one[0], again), *one[1:]] for one in listed]).encode()
    arrow = schema.arrow.with_metadata({**(schema.arrow.metadata or {}), MEMBERS: members})
    path = pack_path(folder, table, _other(name, again))
    writing = {"compression_level": LEVEL, "use_dictionary": schema.dictionary_columns}
    with (
        pq.ParquetFile(source) as file,
        pq.ParquetWriter(path, arrow, compression="zstd", column_encoding=schema.encodings, **writing) as parquet,
    ):
        for group in range(file.num_row_groups):
            content = file.read_row_group(group)
            for column in content.column_names:
                if (changed := _changed(column, content[column], again, shift_ns)) is not None:
                    content = content.set_column(content.column_names.index(column), column, changed)
            parquet.write_table(content.cast(arrow), row_group_size=len(content))
    return path


def _changed(name: str, values: pa.ChunkedArray, again: int, shift_ns: int) -> pa.Array | None:
    """A column as the copy has it; None where it is the same."""
    if name in ("recording_id", "measurement_id", "judgement_id", "name", "path"):
        coded = values.combine_chunks().dictionary_encode()
        known = coded.dictionary.to_pylist()
        ids = name.endswith("_id")
        return pa.array([_other(one, again) if ids else f"{one}.{again}" for one in known]).take(coded.indices)
    if name in ("stamp_ns", "from_ns", "to_ns", "first_stamp_ns", "last_stamp_ns"):
        return pa.compute.add(values, shift_ns).combine_chunks()
    if name == "outputs":
        return pa.nulls(len(values), values.type)
    return None


def _other(row_id: str, again: int) -> str:
    return sha256(f"{row_id} {again}".encode()).hexdigest()[: len(row_id)]


def cost(words: Sequence[str]) -> tuple[float, float, int]:
    """CPU seconds of a command and all its workers, the peak memory of one process in MB, and the exit code."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)  # what the command leaves running is waited for here
    process = subprocess.Popen(
        [sys.executable, "-m", "auditor", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    seconds, memory = 0.0, 0.0
    with suppress(ChildProcessError):
        while True:
            ended, status, used = os.wait4(-1, 0)
            seconds, memory = seconds + used.ru_utime + used.ru_stime, max(memory, used.ru_maxrss / 1024)
            if ended == process.pid:
                process.returncode = os.waitstatus_to_exitcode(status)
    return seconds, memory, process.returncode


def verbs(store: Path) -> Iterator[tuple[str, list[str]]]:
    """The verbs that are measured, in this order."""
    where = ["--store", str(store)]
    yield "summary", ["query", "summary", "--format", "csv", *where]
    yield "incidents", ["query", "incidents", "--format", "csv", *where]
    yield "calibrate", ["calibrate", str(store), "--store", f"{store}.calibrated"]
    yield "judge", ["judge", str(store)]
    yield "verify", ["verify", str(store)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, nargs="+", default=[100, 200, 400])
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--tables", nargs="*", default=[*OF_FRAMES[1:], "verdicts"], help="those that have rows")
    parser.add_argument("--verbs", nargs="*", default=["summary", "incidents", "calibrate", "judge", "verify"])
    parser.add_argument("--pack", action="store_true", help="measure the verbs again in the packed store")
    parser.add_argument("--times", type=int, default=1, help="also a packed store so many times as large")
    parser.add_argument("--into", type=Path, help="keep the store in this folder")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder, before = (options.into or Path(place)) / "audit", 0
        for recordings in options.recordings:
            fill(folder, recordings - before, options.frames, options.tables, before)
            before = recordings
            _report(folder, recordings, options)
            if options.pack:
                print(f"{_size(folder)}; packing took {cost(['store', 'compact', str(folder)])[0]:.2f} CPU s")
                print(_size(folder))
                _report(folder, recordings, options)
        if options.pack and options.times > 1:
            multiply(folder, options.times)
            print(_size(folder))
            _report(folder, before * options.times, options)


def _report(folder: Path, recordings: int, options: argparse.Namespace) -> None:
    for verb, words in verbs(folder):
        if verb in options.verbs:
            seconds, memory, code = cost(words)
            each = 1000 * seconds / (recordings * options.frames)
            print(
                f"{recordings:6} recordings {verb:10} {seconds:7.2f} CPU s, {each:.4f} ms a frame, "
                f"{memory:5.0f} MB, exit {code}",
                flush=True,
            )


def _size(folder: Path) -> str:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return f"{len(files)} files, {sum(path.stat().st_size for path in files) / 1e6:.1f} MB"


if __name__ == "__main__":
    main()
