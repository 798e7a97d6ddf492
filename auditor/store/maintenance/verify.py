"""Verifying a store: its log is whole, and every file is as the log and the rows that finish files say.

The log has the hashes of the files that no row names; rows of manifests, which are such files, have those of the rest.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from auditor.store.files import is_part
from auditor.store.folder import MARKER, UPGRADED, StoreFolder, marker_content
from auditor.store.log.chains import LOG, Chain, chain_paths, heads, in_order, read_chains
from auditor.store.log.entry import Entry, OutputFile
from auditor.store.log.runs import expected
from auditor.store.log.signatures import unsigned
from auditor.store.maintenance.hashes import PAGES, Hashes, changed, read_checked
from auditor.store.maintenance.plausibility import implausible, untied
from auditor.store.packs.index import FOLDER, INDEX, Files, Member, Packs
from auditor.store.schema import MANIFESTS, TABLES, id_column
from auditor.store.store import Store
from auditor.store.tables import listed, read_table, rows_of_files

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

_MANIFESTS = frozenset(MANIFESTS.values())
_AT_MOST = 3
_PICTURES = "pictures"
_PARQUET = ".parquet"


@dataclass(frozen=True)
class Problem:
    """Something that is not as it should be: where, and what. One that is not `grave` was left by a killed run."""

    place: str
    what: str
    grave: bool = True

    def __str__(self) -> str:
        return f"{self.place}: {self.what}"


@dataclass(frozen=True)
class VerifyResult:
    """What was found: problems, how much was looked at, and runs that are under way."""

    problems: tuple[Problem, ...]
    files: int
    entries: int
    chains: int
    open_runs: tuple[Entry, ...]

    @property
    def grave(self) -> tuple[Problem, ...]:
        """The problems but for what killed runs left."""
        return tuple(problem for problem in self.problems if problem.grave)


def verify(store: StoreFolder, key: "Ed25519PublicKey | None" = None) -> VerifyResult:
    """Look at every file of a store, and at its signatures where a key is given.

    What runs write meanwhile is looked at again. Raises StoreError.
    """
    return _settled(store, lambda: _Verification(store, Hashes(store.folder, {})).verified(key, deep=True))


def verify_hashes(store: StoreFolder) -> VerifyResult:
    """Hash every file of a store, and nothing else. Raises StoreError."""
    return _settled(store, lambda: _Verification(store, Hashes(store.folder, {})).verified())


def verify_changes(store: StoreFolder) -> VerifyResult:
    """Look at the files of a store that have changed since they were last looked at. Raises StoreError."""
    checked = read_checked(store.folder)
    touched = {_row_id(place) for place in changed(store.folder, checked)}
    return _settled(store, lambda: _Verification(store, Hashes(store.folder, checked), touched).verified())


def _settled(store: StoreFolder, look: Callable[[], VerifyResult]) -> VerifyResult:
    """What was found while no run wrote to the store, or at the last try."""
    for _ in range(_AT_MOST):
        before = heads(store.folder)
        result = look()
        if not result.grave or heads(store.folder) == before:
            break
    return result


def _row_id(place: str) -> str:
    """The id of the row that a file of a table, or a picture, belongs to."""
    parts = place.split("/")
    return parts[1].removesuffix(".parquet") if len(parts) > 1 else place


class _Verification:
    """One look at a store; at all of it, or at the rows `touched` of manifests."""

    def __init__(self, store: StoreFolder, hashes: Hashes, touched: set[str] | None = None) -> None:
        self._store = Store(store.folder)
        self._hashes = hashes
        self._touched = touched
        self._chains = read_chains(store.folder)
        self._entries = in_order(self._chains)
        self._log = expected(self._entries)
        self._seen: set[str] = set()
        self._wrong: set[str] = set()
        self._rigs: dict[str, str] = {}
        self._removed: dict[str, Problem] = {}

    def verified(self, key: "Ed25519PublicKey | None" = None, *, deep: bool = False) -> VerifyResult:
        """What is found; `deep` looks into the files, too."""
        problems = list(self._problems())
        if deep and self._entries and not self._broken_packs:
            problems += self._inside()
        if key is not None:
            problems += (Problem(place, what) for place, what in unsigned(self._chains, key))
        self._keep()
        return VerifyResult(
            tuple(problems), len(self._seen), len(self._entries), len(self._chains), self._log.open_runs
        )

    def _problems(self) -> Iterator[Problem]:
        yield from log_problems(self._chains)
        yield from self._of_marker()
        if not self._entries:
            if any(self._store.ids(manifest) for manifest in _MANIFESTS):
                yield Problem(LOG, "there is no entry in it: nothing says how the files should be")
            return
        for place in sorted(self._log.places):
            yield from self._noted(self._of_logged(place))
        self._store.packs = Packs(self._store.folder, without=self._wrong)
        for manifest in sorted(_MANIFESTS):
            yield from self._noted(self._of_manifest(manifest))
        yield from self._noted(iter(self._removed.values()))
        yield from self._noted(self._added())

    def _keep(self) -> None:
        """Keep what was found right, to be hashed again only once it changes."""
        for path in chain_paths(self._store.folder):
            self._hashes.of(f"{LOG}/{path.name}")
        self._hashes.of(MARKER)
        self._hashes.keep(self._wrong)

    def _inside(self) -> Iterator[Problem]:
        """What does not fit inside the files that are as they were finished."""
        for table in TABLES:
            right = [one for one in self._store.ids(table) if f"{table}/{one}.parquet" not in self._wrong]
            problems = untied(self._store, table, right)
            yield from self._noted(Problem(f"{table}/{row_id}.parquet", what) for row_id, what in problems)
        yield from self._noted(self._implausible())

    def _noted(self, problems: Iterator[Problem]) -> Iterator[Problem]:
        for problem in problems:
            self._wrong.add(problem.place)
            yield problem

    def _of_marker(self) -> Iterator[Problem]:
        self._seen.add(MARKER)
        if (self._store.folder / MARKER).read_bytes() != marker_content():
            yield Problem(MARKER, "it is not as auditor writes it")

    def _of_logged(self, place: str) -> Iterator[Problem]:
        in_log = self._log.places[place]
        path = self._store.folder / place
        if not path.is_file():
            if not in_log.accepts(None):
                yield Problem(place, f"it is missing: {self._log.told(place)} wrote it")
            return
        self._seen.add(place)
        if in_log.accepted == (None,):
            problem = Problem(place, f"it was added: {self._log.told(place)} removed it")
            if _is_unfinished(place) and place.endswith(_PARQUET):  # it was packed, and made again: a row finishes it
                if not self._is_apart(place):  # else its row is not looked at
                    self._removed[place] = problem
            else:
                yield problem
        elif not in_log.accepts(self._hashes.of(place)):
            yield Problem(place, f"it is not as {self._log.told(place)} wrote it")

    def _of_manifest(self, manifest: str) -> Iterator[Problem]:
        """The files that the rows of a manifest finish, by rows that are as they were written."""
        files, column = self._store.files(manifest), id_column(manifest)
        columns = [column, "outputs", *(["rig_id"] if manifest == "measurements" else [])]
        for path in files.alone:
            place = f"{manifest}/{path.name}"
            wanted = self._touched is None or path.stem in self._touched
            if wanted and place in self._log.places and place not in self._wrong:
                yield from self._of_rows(place, listed(read_table(manifest, path, columns), path))
        for path in files.packs:
            place = path.relative_to(self._store.folder).as_posix()
            looked_at = self._wanted(manifest, self._store.packs.members(path))
            if looked_at and place in self._log.places:
                rows = rows_of_files(manifest, Files((), (path,), files.hidden), columns)
                yield from self._of_rows(place, [row for row in rows if row[column] in looked_at])

    def _wanted(self, manifest: str, members: Collection[str]) -> Collection[str]:
        """The members of a pack that are to be looked at: all, or those of which something has changed."""
        touched = self._touched
        return members if touched is None or manifest in touched else touched.intersection(members)

    def _of_rows(self, place: str, rows: list[dict[str, object]]) -> Iterator[Problem]:
        """The files that rows finish, as they were, or packs that were made of them."""
        self._rigs |= {str(row["measurement_id"]): str(row["rig_id"]) for row in rows if "rig_id" in row}
        for output in outputs_of(rows):
            path = self._store.folder / output.path
            self._seen.add(output.path)
            self._removed.pop(output.path, None)
            packed = None if path.is_file() else self._packed(output.path)
            if packed is None and not path.is_file():
                if not self._is_in_broken_pack(output.path):
                    yield Problem(output.path, f"it is missing: {place} names it")
            elif packed is not None and (packed.size, packed.sha256) != (output.size, output.sha256):
                yield Problem(output.path, f"what was packed is not what {place} finished")
            elif packed is None and self._hashes.of(output.path) != output:
                yield Problem(output.path, f"it is not as it was when {place} finished it")

    def _is_in_broken_pack(self, place: str) -> bool:
        """Whether it may be in a pack, or named by an index, that is not as it was written, which is said already."""
        table = place.partition("/")[0]
        return any(one == INDEX or one.startswith(f"{FOLDER}/{table}/") for one in self._broken_packs)

    @property
    def _broken_packs(self) -> set[str]:
        """The packs, and the index, that are not as they were written: nothing is read of them."""
        return {place for place in self._wrong if place == INDEX or place.startswith(f"{FOLDER}/")}

    def _packed(self, place: str) -> Member | None:
        """What a pack that is as it was written has of the file in a place; None where none has."""
        table, _, name = place.partition("/")
        member = self._store.packs.member(table, name.removesuffix(".parquet"))
        return member and member[1]

    def _added(self) -> Iterator[Problem]:
        """Files that neither the log nor a row knows."""
        places = {MARKER, *(place for place in self._log.places), *self._seen}
        places |= {f"{LOG}/{path.name}" for path in chain_paths(self._store.folder)}
        for path in sorted(self._store.folder.rglob("*")):
            place = path.relative_to(self._store.folder).as_posix()
            if place in places or self._is_apart(place) or (path.is_dir() and not path.is_symlink()):
                continue
            if is_part(path) or place.startswith(f"{UPGRADED}/"):
                yield Problem(place, "left by a run that was killed, or is being written: nobody reads it", grave=False)
            elif self._is_of_finished(place):
                yield Problem(place, "it was added: no run wrote it")
            elif _is_unfinished(place):
                problem = "it was added, or left by a run that was killed: no row finishes it, and nobody reads it"
                yield Problem(place, problem, grave=False)
            else:
                yield Problem(place, "it was added: no run wrote it")

    def _is_apart(self, place: str) -> bool:
        """Whether nothing is to be said of a place: it is among the pages, or nothing of its row has changed."""
        untouched = self._touched is not None and _row_id(place) not in self._touched
        return untouched or place.startswith(PAGES)

    def _is_of_finished(self, place: str) -> bool:
        """Whether a file of a table or a picture belongs to a finished row, which does not name it."""
        table, _, rest = place.partition("/")
        manifest = "measurements" if table == _PICTURES else MANIFESTS.get(table, "")
        row_id = rest.partition("/")[0].removesuffix(".parquet")
        packed = bool(manifest) and self._store.packs.member(manifest, row_id) is not None
        return packed or (bool(manifest) and f"{manifest}/{row_id}.parquet" in self._seen)

    def _implausible(self) -> Iterator[Problem]:
        tables = [table for table, manifest in MANIFESTS.items() if manifest == "measurements"]
        for measurement, rig_id in sorted(self._rigs.items()):
            needed = {f"{table}/{measurement}.parquet" for table in ("measurements", *tables)}
            if not self._wrong & {*needed, f"rigs/{rig_id}.parquet"}:
                for table, sentence in implausible(self._store, measurement, self._store.rig(rig_id)):
                    yield Problem(f"{table}/{measurement}.parquet", sentence)


def outputs_of(rows: list[dict[str, object]]) -> list[OutputFile]:
    """The files that the rows of a manifest's file finish."""
    all_outputs = (row["outputs"] or () for row in rows)
    return [OutputFile.of_fields(one) for outputs in all_outputs for one in outputs]  # type: ignore[attr-defined]


def log_problems(chains: list[Chain]) -> Iterator[Problem]:
    """What is wrong with the chains: lines that were changed, and entries that another chain saw and that are gone."""
    hashes = {chain.name: {entry.sha256 for entry in chain.entries} for chain in chains}
    broken = set()
    for chain in chains:
        for problem in chain.problems:
            broken.add(chain.name)
            yield Problem(f"{LOG}/{chain.name}.jsonl", problem)
    for chain in chains:
        for entry in chain.entries:
            for name, sha256 in entry.what.get("heads", {}).items():
                if name not in broken and sha256 not in hashes.get(name, ()):
                    broken.add(name)
                    sentence = "entries are gone" if name in hashes else "it is missing"
                    yield Problem(f"{LOG}/{name}.jsonl", f"{sentence}: {chain.name} saw them at {entry.at[:19]}Z")


def _is_unfinished(place: str) -> bool:
    """Whether it is a file of a table, or a picture, that a row of another table would have to finish."""
    table, _, rest = place.partition("/")
    return (table in MANIFESTS or table == _PICTURES) and bool(rest)
