"""Messages, topics and definitions of one .db3 file of rosbag2 (tables topics, messages, message_definitions).

The tables are found through the file's own catalogue. Where that or anything else is damaged, all other pages are
searched for rows with the column types of these tables.
"""

from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from pathlib import Path

from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.recordings.formats.files import FileRead
from auditor.recordings.formats.found import DamageLog, Names, Span, span_over
from auditor.recordings.formats.sqlite_pages import ENDING, LEAF, BadPageError, Pages, TableRow, read_journal
from auditor.recordings.formats.unpacking import BadChunkError, Source, unpack_message
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.schemas import schema_name
from auditor.safety.budget import MAX_BYTES

_CATALOGUE_PAGE = 1
_CATALOGUE_ROW = "tttit"
_MESSAGE_ROW = "niib"
_NAMES_ROW = "nttt"
_MAX_NAMES_ROWS = 100_000
_DEFINITION_ENCODINGS = {"ros2msg", "ros2idl"}


def journal_of(path: Path) -> Path | None:
    """The write-ahead log beside a database; None where there is none or it is empty."""
    journal = path.with_name(f"{path.name}{ENDING}")
    return journal if journal.is_file() and journal.stat().st_size else None


class Db3Read(FileRead):
    """One read of one file: yields messages as they were recorded, counts all of them, notes damage."""

    encoding = "cdr"

    def __init__(self, source: Source, wanted: Collection[str] | None, names: Names, damage: DamageLog) -> None:
        super().__init__(source, wanted, names, damage)
        self._bad_rows = 0
        self._lost_messages = 0

    def learn_topics(self) -> None:
        """Learn topics and definitions. Raises RecordingError where the file is not a recording."""
        with self._pages() as pages:
            self._learn_names(pages)

    def messages(self) -> Iterator[Message]:
        """Every message of the requested topics. Raises RecordingError where the file is not a recording."""
        with self._pages() as pages:
            try:
                yield from self._walk(pages, self._learn_names(pages))
            except OSError as error:
                self._damage.add(f"it cannot be read further ({error.strerror or error})")
            self._note_totals(pages)
        self.channels.note_unknown()

    def span_ns(self) -> Span | None:
        """The times of the first and the last row: a recorder writes them in this order. None where one is not there.

        Raises RecordingError where the file is not a recording.
        """
        with self._pages() as pages:
            root = self._catalogue(pages).get("messages")
            ends = [pages.end_leaf(root, last=last) for last in (False, True)] if root is not None else [None]
            pages_at_ends = [page for page in ends if page is not None]
            if len(pages_at_ends) < len(ends):
                return None
            return span_over(time_ns for page in pages_at_ends for time_ns in self._times_ns(pages, page))

    def _times_ns(self, pages: Pages, page: int) -> Iterator[int]:
        for row in self._rows(pages, page):
            if row.kinds.startswith(_MESSAGE_ROW):
                with suppress(BadPageError):
                    value = pages.value(row, 2)
                    yield from (value,) if isinstance(value, int) else ()

    @contextmanager
    def _pages(self) -> Iterator[Pages]:
        """The pages of the file, together with those of its write-ahead log where its recorder left one."""
        with ExitStack() as opened:
            file, size = opened.enter_context(self._source.open()), self._source.size
            written = self._source.journal
            log = opened.enter_context(written.open()) if written else None
            journal = read_journal(log, written.size) if written and log else None
            if written and journal is None:
                self._damage.add(f"{written.path.name} is not a readable write-ahead log")
            pages = Pages(file, size)
            if journal and written:
                if pages.has_header and pages.page_bytes != journal.page_bytes:
                    self._damage.add(f"{written.path.name} has pages of another size and is not read")
                else:
                    pages = Pages(file, size, journal, log)
                    if journal.problem:
                        self._damage.add(f"{written.path.name}: {journal.problem}")
            yield pages

    def _walk(self, pages: Pages, root: int | None) -> Iterator[Message]:
        seen: set[int] = set()
        bad: list[int] = []
        for page in pages.leaves(root, bad) if root is not None else ():
            seen.add(page)
            for row in self._rows(pages, page):
                if row.kinds.startswith(_MESSAGE_ROW):
                    yield from self._message(pages, row)
                else:
                    self._bad_rows += 1
        for page in bad:
            self._damage.add(f"page {page} of the messages cannot be read")
        if bad or root is None:
            for row in self._strays(pages, seen):
                if row.kinds.startswith(_MESSAGE_ROW):
                    yield from self._message(pages, row)

    def _message(self, pages: Pages, row: TableRow) -> Iterator[Message]:
        try:
            channel_id, log_time_ns = pages.value(row, 1), pages.value(row, 2)
            assert isinstance(channel_id, int)
            assert isinstance(log_time_ns, int)
            channel = self.channels.count_message(channel_id, row.columns[3].length)
            if channel is None or not channel.wanted:
                return
            data = pages.value(row, 3, MAX_BYTES)
        except BadPageError:
            self._lost_messages += 1
            return
        assert isinstance(data, bytes)
        try:
            data = unpack_message(data, self._spending)
        except BadChunkError as error:
            self._damage.add(f"a message of {channel.topic.name!r} is left out: {error}")
            return
        topic = channel.topic
        yield Message(topic.name, topic.schema, topic.encoding, log_time_ns, data)

    def _learn_names(self, pages: Pages) -> int | None:
        """Learn topics and definitions; returns the first page of the messages, None where the catalogue is damaged."""
        roots = self._catalogue(pages)
        bad: list[int] = []
        for name in ("message_definitions", "topics"):
            for page in islice(pages.leaves(roots[name], bad), _MAX_NAMES_ROWS) if name in roots else ():
                for row in islice(self._rows(pages, page), _MAX_NAMES_ROWS):
                    self._learn(pages, row)
        if bad or "topics" not in roots:
            self._damage.add("the list of its topics is damaged")
            for row in self._strays(pages, set()):
                self._learn(pages, row)
        return roots.get("messages")

    def _catalogue(self, pages: Pages) -> dict[str, int]:
        """The first page of every table by name. Raises RecordingError where the file is not a recording."""
        if not pages.count or not (pages.has_header or any(True for _ in self._strays(pages, set()))):
            raise RecordingError("this is not a SQLite file, or its beginning is cut", where=self._source.path)
        roots: dict[str, int] = {}
        bad: list[int] = []
        for page in pages.leaves(_CATALOGUE_PAGE, bad) if pages.has_header else ():
            for row in self._rows(pages, page):
                try:
                    if row.kinds.startswith(_CATALOGUE_ROW) and pages.value(row, 0) == "table":
                        name, root = pages.value(row, 1), pages.value(row, 3)
                        roots.setdefault(str(name), root if isinstance(root, int) else 0)
                except BadPageError:
                    self._bad_rows += 1
        if bad or not pages.has_header:
            self._damage.add("its first page is damaged: rows are found by their column types", 0)
        elif not {"topics", "messages"} <= roots.keys() and not self._bad_rows:
            raise RecordingError(
                "this is not a ROS 2 recording: it has no tables of topics and messages", where=self._source.path
            )
        return roots

    def _learn(self, pages: Pages, row: TableRow) -> None:
        """Learn a topic or a definition: their columns have the same types, and only a definition has its encoding."""
        if not row.kinds.startswith(_NAMES_ROW):
            return
        try:
            first, second, third = (str(pages.value(row, column)) for column in (1, 2, 3))
        except BadPageError:
            self._bad_rows += 1
            return
        if second in _DEFINITION_ENCODINGS:
            self._names.add_definition(schema_name(first), Definition(second, third.encode()), self._damage)
        else:
            self.channels.learn(row.number, Topic(first, schema_name(second), third))

    def _rows(self, pages: Pages, page: int) -> Iterator[TableRow]:
        try:
            for row in pages.rows(page):
                if row is None:
                    self._bad_rows += 1
                else:
                    yield row
        except BadPageError as error:
            self._damage.add(f"page {page} is left out ({error})", pages.offset(page))

    def _strays(self, pages: Pages, seen: Collection[int]) -> Iterator[TableRow]:
        """Rows of all leaf pages except those seen; pages that only resemble a leaf are skipped."""
        for page in range(1, pages.count + 1):
            try:
                if page not in seen and pages.kind(page) == LEAF:
                    yield from (row for row in pages.rows(page) if row is not None)
            except BadPageError:
                continue

    def _note_totals(self, pages: Pages) -> None:
        if self._bad_rows:
            self._damage.add(f"{self._bad_rows} rows cannot be read")
        if self._lost_messages:
            self._damage.add(f"{self._lost_messages} messages are cut or too large")
        if pages.is_cut:
            self._damage.add("the recording is cut", pages.size)
