"""What one read of a file finds beside its messages: topics, definitions, channels, and damage."""

from collections.abc import Collection, Iterable, Mapping

from auditor.recordings.recording import Damage, Definition, Topic, Traffic
from auditor.recordings.schemas import schema_name

MAX_ENTRIES = 100
_ZEROS = bytes(512)


class DamageLog:
    """Collects Damage; beyond MAX_ENTRIES it only counts. `of` gives the log of one of several files."""

    def __init__(self, file: str = "", whole: "DamageLog | None" = None) -> None:
        self._file = file
        self._whole = whole or self
        self._entries: list[Damage] = []
        self._more = 0
        self.count = 0
        """The number of damaged parts noted through this log."""

    def of(self, file: str) -> "DamageLog":
        """The log of one file: what is added to it belongs to this log, with the name of the file."""
        return DamageLog(file, self)

    def add(self, problem: str, offset: int | None = None) -> None:
        """Note one damaged part."""
        self.count += 1
        self._whole._keep(Damage(problem, offset, self._file))

    def _keep(self, damage: Damage) -> None:
        if len(self._entries) < MAX_ENTRIES:
            self._entries.append(damage)
        else:
            self._more += 1

    @property
    def entries(self) -> tuple[Damage, ...]:
        """The damaged parts noted, the first MAX_ENTRIES in full."""
        if not self._more:
            return tuple(self._entries)
        return (*self._entries, Damage(f"and {self._more} more damaged places"))


def is_trusted(data: bytes | memoryview) -> bool:
    """True for the data of a whole record without a run of zeros, which a crash may leave in place of data.

    A record that is wrongly left out is reported as damage, like the rest of the cut chunk.
    """
    return bytes(data).find(_ZEROS) < 0


MAX_TOPICS = 10_000
MAX_NAME = 4096
MAX_DEFINITION_BYTES = 64 * 2**20
MAX_CHANNELS = 100_000

Span = tuple[int, int]
"""The first and last log time of a file, in nanoseconds."""


def span_over(times_ns: Iterable[int]) -> Span | None:
    """The first and the last of some times; None where there are none."""
    first = last = None
    for time_ns in times_ns:
        first = time_ns if first is None else min(first, time_ns)
        last = time_ns if last is None else max(last, time_ns)
    return None if first is None or last is None else (first, last)


class Names:
    """Topics and schema definitions, gathered from summaries and from reading; the first of a name counts."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.definitions: dict[str, Definition] = {}
        self._definition_bytes = 0

    def add_topic(self, topic: Topic, damage: DamageLog) -> bool:
        """Add a topic that there is room for; False, noting the damage, where its name is too long."""
        if len(topic.name) > MAX_NAME or len(topic.schema) > MAX_NAME:
            damage.add(f"a topic whose name or type has more than {MAX_NAME} characters is left out")
            return False
        self.topics.setdefault(topic.name, topic)
        return True

    def has_room_for(self, topic: Topic) -> bool:
        """False where the topic is new and there are MAX_TOPICS already."""
        return topic.name in self.topics or len(self.topics) < MAX_TOPICS

    def add_definition(self, schema: str, definition: Definition, damage: DamageLog, offset: int | None = None) -> None:
        """Add a definition, noting the damage where it differs from an earlier one, or where there are too many.

        One without text gives way to any other; a text of no more than the name, as a converter of clouds writes, is
        none.
        """
        if len(definition.data) <= MAX_NAME and schema_name(definition.text.strip()) == schema:
            definition = Definition(definition.encoding, b"")
        earlier = self.definitions.get(schema)
        if earlier is None or earlier.is_blank:
            self._definition_bytes += len(definition.data) + len(schema)
            if self._definition_bytes > MAX_DEFINITION_BYTES:
                damage.add(f"the definition of {schema[:80]!r} is left out: there are too many", offset)
            else:
                self.definitions[schema] = definition
        elif not (definition.is_blank or earlier.says_the_same(definition)):
            damage.add(f"a second, different definition of {schema[:80]!r} is ignored", offset)


class Channel:
    """One channel (MCAP), connection (.bag) or topic number (.db3) of one file during one read."""

    __slots__ = ("count", "size_bytes", "topic", "wanted")

    def __init__(self, topic: Topic, *, wanted: bool) -> None:
        self.topic = topic
        self.wanted = wanted
        self.count = 0
        self.size_bytes = 0


class Channels:
    """The channels of one file by number, each with the count of its messages."""

    def __init__(self, wanted: Collection[str] | None, names: Names, damage: DamageLog) -> None:
        self._wanted = None if wanted is None else frozenset(wanted)
        self._names = names
        self._damage = damage
        self._known: dict[int, Channel] = {}
        self._spare: dict[int, Channel] = {}
        self._unknown: dict[int, int] = {}
        self._left_out: set[int] = set()
        self.total = 0

    def learn(self, number: int, topic: Topic, *, spare: bool = False) -> None:
        """Add a channel; the first of a number counts. Channels of an index are spare: those of the data come first."""
        where = self._spare if spare else self._known
        if number in where or number in self._left_out or len(where) + len(self._left_out) >= MAX_CHANNELS:
            return
        if not self._names.has_room_for(topic):
            self._left_out.add(number)
        elif self._names.add_topic(topic, self._damage):
            where[number] = Channel(topic, wanted=self._wanted is None or topic.name in self._wanted)

    def count_message(self, number: int, size_bytes: int) -> Channel | None:
        """Count a message and its bytes; None where its channel is unknown."""
        channel = self._known.get(number)
        if channel is None and (channel := self._spare.get(number)) is not None:
            self._known[number] = channel
        if channel is None:
            if number in self._unknown or len(self._unknown) < MAX_CHANNELS:
                self._unknown[number] = self._unknown.get(number, 0) + 1
            return None
        channel.count += 1
        channel.size_bytes += size_bytes
        self.total += 1
        return channel

    def note_unknown(self) -> None:
        """Note the messages of channels that the file does not define, and topics beyond MAX_TOPICS in one line."""
        if self._left_out:
            lost = sum(self._unknown.pop(number, 0) for number in self._left_out)
            self._damage.add(
                f"it has more than {MAX_TOPICS} topics: {len(self._left_out)} are left out, and their {lost} messages"
            )
        for number, count in self._unknown.items():
            self._damage.add(f"{count} messages belong to no channel ({number})")

    def add_traffic(self, traffic: dict[Topic, Traffic]) -> None:
        """Add the messages found and their bytes to those by topic and type."""
        for channel in self._known.values():
            before = traffic.get(channel.topic, Traffic())
            traffic[channel.topic] = Traffic(before.messages + channel.count, before.size_bytes + channel.size_bytes)


def total_traffic(reads: Collection[Channels]) -> Mapping[Topic, Traffic]:
    """The messages found and their bytes, by topic and type, over several files."""
    traffic: dict[Topic, Traffic] = {}
    for read in reads:
        read.add_traffic(traffic)
    return traffic
