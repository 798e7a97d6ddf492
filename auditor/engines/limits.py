"""What one task may take before its process is ended."""

from dataclasses import dataclass
from pathlib import Path

MEMORY_MB = 4096
SILENT_S = 600.0
SECONDS_A_MB = 0.1
"""Reading at 10 MB/s: what must be read before the first frame comes may be as large as the recording."""


@dataclass(frozen=True)
class Limits:
    """Budgets of one task: `memory_mb` of its process, `seconds` in all, `silent_s` without any progress.

    None stands for no limit.
    """

    memory_mb: float | None = None
    seconds: float | None = None
    silent_s: float | None = None

    def exceeded(self, *, memory_mb: float, seconds: float, silent_s: float) -> str:
        """Which budget a task is over, as a sentence; empty where it is within all of them."""
        if self.memory_mb is not None and memory_mb > self.memory_mb:
            return f"it took more than {self.memory_mb:.0f} MB of memory and was ended"
        if self.seconds is not None and seconds > self.seconds:
            return f"it took longer than {self.seconds:g} s and was ended"
        if self.silent_s is not None and silent_s > self.silent_s:
            return f"no frame came for {self.silent_s:.0f} s and it was ended"
        return ""


def limits_of(size_bytes: int, *, seconds: float | None = None, memory_mb: float = MEMORY_MB) -> Limits:
    """The budgets of one recording of a size; time is not limited while frames come, unless `seconds` is given."""
    silent_s = SILENT_S + SECONDS_A_MB * size_bytes / 1e6
    return Limits(memory_mb, seconds, None if seconds is not None else silent_s)


def memory_mb(pid: int) -> float:
    """What a process has in memory; 0 where it is gone, or the system does not tell."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    _, found, rest = status.partition("VmRSS:")
    return int(rest.split()[0]) / 1024 if found else 0.0
