"""Packing: many small files of a table become few, while others read and write.

New packs are written first; nobody reads them. They come into force when the index is replaced, which is one moment:
before it every id is read from its own file, after it from a pack. Only then its file goes, where nobody reads it. A
process that is killed leaves packs that nobody reads, or files that packs have as well: the next packing takes them.
"""

import fcntl
import hashlib
import json
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from auditor.store.files import finished, part_file, write_whole
from auditor.store.folder import MARKER
from auditor.store.log.chains import entries, is_mirror
from auditor.store.log.entry import OutputFile, output_of
from auditor.store.log.runs import LogState, Run, expected, logged
from auditor.store.packs.index import FOLDER, INDEX, MEMBERS, PACKED, Index, Member, index_lock, pack_path
from auditor.store.records import content_id
from auditor.store.schema import MANIFESTS, id_column, table_schema
from auditor.store.store import Store
from auditor.store.tables import Source, read_table, rows_of_files

SMALL_BYTES = 1 << 20
"""Larger files stay as they are: they are few, and one that is read whole gains nothing."""

PACK_BYTES = 64 << 20
"""The bytes of the files that a pack is made of, about; one of less than half of it is made anew with what is new."""

MANY_FILES = 2000
"""So many small files are packed after a scan: it takes some seconds, and questions take as much less each time."""

GROUP_ROWS, GROUP_MEMBERS = 4096, 64
"""A row group is closed with so many rows, or ids: those of one id are read without those of many others."""

TOGETHER = {"verdicts": 8}
"""Tables of which nobody reads one id: questions read all. So many times as large row groups take half the room."""

LEVEL = 9
"""The level of zstd: what is packed is written once and kept for long."""

Identity = tuple[int, int, int]


@dataclass(frozen=True)
class PackingResult:
    """What a packing did: how many files it took, into how many packs, and how many of them are left to be removed."""

    files: int = 0
    packs: int = 0
    left: int = 0


@dataclass(frozen=True)
class _Piece:
    """The rows of an id that are packed: where they are read, the file that had them first, and its own file now."""

    source: Source
    first: OutputFile
    row_id: str
    own: Path | None = None
    identity: Identity | None = None


def pack(store: Store, least: int = 2) -> PackingResult:
    """Pack the small files of each table that has at least so many of them.

    A file that is not as it was written stays as it is: `auditor verify` names it. Raises StoreError.
    """
    done = PackingResult()
    with logged(store.folder) as entry, index_lock(store.folder):
        tables = [table for table in PACKED if len(_small(store, table)) >= least]
        log_state = expected(entries(store.folder)) if tables else LogState()
        for table in tables:
            of_table = _pack_table(store, table, log_state, entry)
            done = PackingResult(done.files + of_table.files, done.packs + of_table.packs, done.left + of_table.left)
        _remove_unread(store, entry)
    return done


def pack_where_many(store: Store) -> PackingResult:
    """Pack the small files of a store where many have gathered; of a mirror never. Raises StoreError."""
    return (
        PackingResult()
        if is_mirror(store.folder)
        else pack(store)
        if small_files(store) >= MANY_FILES
        else PackingResult()
    )


def small_files(store: Store) -> int:
    """How many files a packing would take."""
    return sum(len(_small(store, table)) for table in PACKED)


def _pack_table(store: Store, table: str, log_state: LogState, entry: Run) -> PackingResult:
    own = list(_own(store, table, log_state))
    if not own:
        return PackingResult()
    counting = set(store.ids(table)) - set(finished(store.folder / table))
    old = [path for path in store.packs.paths(table) if _is_made_anew(store, path, counting)]
    packed = [piece for path in old for piece in _of_pack(store, table, path, counting)]
    new = [_write(store, table, portion, entry) for portion in _portions([*own, *packed])]
    index = store.packs.index
    stay = [path.stem for path in store.packs.paths(table) if path not in old]
    packs = {**index.packs, table: (*stay, *(path.stem for path in new))}
    removed = {name: ids for name, ids in index.removed.items() if name != table}  # no pack has rows of them now
    gone = _put_in_force(store, Index(packs, removed), own, [path for path in old if path not in new], entry)
    return PackingResult(len(own), len(new), len(own) - gone)


def _small(store: Store, table: str) -> list[Path]:
    """The finished files of a table that are small enough."""
    ids = set(store.ids(table))
    paths = (store.path(table, one) for one in finished(store.folder / table) if one in ids)
    return [path for path in paths if path.stat().st_size <= SMALL_BYTES]


def _own(store: Store, table: str, log_state: LogState) -> Iterator[_Piece]:
    """The small files of a table that are as they were written."""
    manifest = MANIFESTS.get(table)
    named = _named(store, manifest) if manifest else {}
    for path in _small(store, table):
        identity, output = _identity(path), output_of(path, store.folder)
        place = log_state.places.get(output.path)
        if named.get(output.path) == output or (manifest is None and place is not None and place.accepted == (output,)):
            yield _Piece(path, output, path.stem, path, identity)


def _named(store: Store, manifest: str) -> dict[str, OutputFile]:
    """The files that the rows of a manifest finish, by their places."""
    rows = rows_of_files(manifest, store.files(manifest), [id_column(manifest), "outputs"])
    outputs = (OutputFile.of_fields(one) for row in rows for one in row["outputs"] or ())
    return {output.path: output for output in outputs}


def _is_made_anew(store: Store, path: Path, counting: Collection[str]) -> bool:
    """Whether a pack is not half full, or has rows that count no longer."""
    members = store.packs.members(path)
    return sum(one.size for one in members.values()) < PACK_BYTES // 2 or not members.keys() <= set(counting)


def _of_pack(store: Store, table: str, path: Path, counting: Collection[str]) -> Iterator[_Piece]:
    for member in store.packs.members(path).values():
        if member.row_id in counting:
            first = OutputFile(f"{table}/{member.row_id}.parquet", member.size, member.sha256)
            yield _Piece(store.source(table, member.row_id), first, member.row_id)


def _portions(pieces: Sequence[_Piece]) -> Iterator[list[_Piece]]:
    """Pieces by id, as many as one pack takes."""
    portion: list[_Piece] = []
    size = 0
    for piece in sorted(pieces, key=lambda one: one.row_id):
        portion.append(piece)
        size += piece.first.size
        if size >= PACK_BYTES:
            yield portion
            portion, size = [], 0
    if portion:
        yield portion


def _write(store: Store, table: str, pieces: Sequence[_Piece], entry: Run) -> Path:
    """Write a pack, which nobody reads yet."""
    firsts = [[piece.row_id, piece.first.size, piece.first.sha256] for piece in pieces]
    path = pack_path(store.folder, table, content_id("pack", table, firsts))
    groups, members = _grouped(table, pieces)
    schema = table_schema(table)
    listed = json.dumps([list(vars(one).values()) for one in members]).encode()
    arrow = schema.arrow.with_metadata({**(schema.arrow.metadata or {}), MEMBERS: listed})
    with part_file(path) as part:
        with (
            part.reporting(),
            pq.ParquetWriter(
                part.file,
                arrow,
                compression="zstd",
                compression_level=LEVEL,
                use_dictionary=schema.dictionary_columns,
                column_encoding=schema.encodings,
            ) as parquet,
        ):
            for group in groups:
                rows = pa.concat_tables(read_table(table, piece.source) for piece in group)
                parquet.write_table(rows.replace_schema_metadata(arrow.metadata), row_group_size=len(rows))
        part.commit(entry.announce)
    return path


def _grouped(table: str, pieces: Sequence[_Piece]) -> tuple[list[list[_Piece]], list[Member]]:
    """The pieces of each row group, and all members with their groups; pieces without rows are in none."""
    groups: list[list[_Piece]] = []
    members, rows = [], 0
    most_rows, most_members = (TOGETHER.get(table, 1) * most for most in (GROUP_ROWS, GROUP_MEMBERS))
    for piece in pieces:
        count = len(read_table(table, piece.source, [id_column(table)]))
        if count and (not groups or rows >= most_rows or len(groups[-1]) >= most_members):
            groups.append([])
            rows = 0
        if count:
            groups[-1].append(piece)
            rows += count
        group = len(groups) - 1 if count else None
        members.append(Member(piece.row_id, piece.first.size, piece.first.sha256, group))
    return groups, members


def _put_in_force(store: Store, index: Index, own: Sequence[_Piece], old: Sequence[Path], entry: Run) -> int:
    """Replace the index, then remove what is packed and is as it was then, unless somebody reads; returns how much."""
    content = index.content
    written = OutputFile(INDEX, len(content), hashlib.sha256(content).hexdigest())
    with _unread(store.folder) as unread:
        unchanged = [one.own for one in own if one.own is not None and one.identity == _identity(one.own)]
        gone = [*unchanged, *old] if unread else []
        with entry.packing([written], [path.relative_to(store.folder).as_posix() for path in gone]):
            write_whole(store.folder / INDEX, content)
            for path in gone:
                path.unlink(missing_ok=True)
    return len(unchanged) if unread else 0


def _remove_unread(store: Store, entry: Run) -> None:
    """Remove packs that the index does not name: a killed packing left them, or somebody read them until now."""
    packs = {path for table in PACKED for path in store.packs.paths(table)}
    unnamed = [path for path in (store.folder / FOLDER).glob("*/*.parquet") if path not in packs]
    with _unread(store.folder) as unread:
        if unnamed and unread:
            places = [path.relative_to(store.folder).as_posix() for path in unnamed]
            with entry.removing(places, "no index names these packs"):
                for path in unnamed:
                    path.unlink(missing_ok=True)


@contextmanager
def _unread(folder: Path) -> Iterator[bool]:
    """Whether no connection reads the files of a store; none begins to within the block."""
    with (folder / MARKER).open("rb") as marker:
        try:
            fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            yield False
        else:
            yield True


def _identity(path: Path) -> Identity | None:
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns
