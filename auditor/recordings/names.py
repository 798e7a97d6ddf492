"""Topics and definitions that a recording was found to have."""

from auditor.recordings.damage_log import DamageLog
from auditor.recordings.interface import Definition, Topic

MAX_TOPICS = 10_000
MAX_NAME = 4096
MAX_DEFINITION_BYTES = 64 * 2**20


class Names:
    """Topics and schema definitions, gathered from summaries and from reading; the first of a name counts."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.definitions: dict[str, Definition] = {}
        self._definition_bytes = 0

    def add_topic(self, topic: Topic, damage: DamageLog) -> bool:
        """Take in one more; False, noting the damage, where its name is absurd or there are absurdly many already."""
        if len(topic.name) > MAX_NAME or len(topic.schema) > MAX_NAME:
            damage.add(f"a topic whose name or type has more than {MAX_NAME} characters is left out")
            return False
        if topic.name not in self.topics and len(self.topics) >= MAX_TOPICS:
            damage.add(f"more than {MAX_TOPICS} topics: {topic.name[:80]!r} is left out")
            return False
        self.topics.setdefault(topic.name, topic)
        return True

    def add_definition(self, schema: str, definition: Definition, damage: DamageLog, offset: int | None = None) -> None:
        """Take in a definition, noting the damage where it is another one than before, or they are too many."""
        known = self.definitions.get(schema)
        if known is None:
            self._definition_bytes += len(definition.data) + len(schema)
            if self._definition_bytes > MAX_DEFINITION_BYTES:
                damage.add(f"the definition of {schema[:80]!r} is left out: there are too many", offset)
            else:
                self.definitions[schema] = definition
        elif known != definition:
            damage.add(f"a second, different definition of {schema[:80]!r} is ignored", offset)
