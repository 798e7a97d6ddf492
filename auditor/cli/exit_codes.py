"""Exit codes: what a script that runs an audit needs to know."""

from dataclasses import dataclass, field
from enum import IntEnum


class Exit(IntEnum):
    """How a command ended; a newcomer finds the list under `auditor --help`."""

    CLEAN = 0
    FINDINGS = 1
    FAILED = 2
    INCOMPLETE = 3
    FINDINGS_INCOMPLETE = 4
    INTERRUPTED = 130
    ENDED = 143


@dataclass(frozen=True)
class NotAudited:
    """A recording that was not audited, or not fully, and the reasons one by one."""

    recording: str
    path: str
    gaps: tuple[str, ...]

    @property
    def reason(self) -> str:
        """All reasons."""
        return "; ".join(self.gaps)


@dataclass
class Tally:
    """What the exit code and the closing line depend on, gathered over all recordings of a command.

    `recordings`, `with_incidents` and `with_alerts` are ids, or paths where nothing could be read. All incidents and
    alerts of those that are `excused` have reviews by which they do not fail.
    """

    found: bool = False
    incomplete: bool = False
    audited: bool = False
    failed: bool = False
    recordings: set[str] = field(default_factory=set)
    with_incidents: set[str] = field(default_factory=set)
    with_alerts: set[str] = field(default_factory=set)
    excused: set[str] = field(default_factory=set)
    not_audited: list[NotAudited] = field(default_factory=list)

    def exit_code(self) -> Exit:
        """0 to 4: see Exit. Without a single recording that could be examined, the command could not run."""
        if self.failed and not self.audited and not self.incomplete:
            return Exit.FAILED
        if self.found:
            return Exit.FINDINGS_INCOMPLETE if self.incomplete or self.failed else Exit.FINDINGS
        return Exit.INCOMPLETE if self.incomplete or self.failed else Exit.CLEAN
