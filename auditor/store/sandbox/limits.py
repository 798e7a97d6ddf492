"""What the SQL of a user may take."""

import os
from dataclasses import dataclass

from auditor.errors import LimitError

_BESIDE_BYTES = 1 << 30
_THREAD_BYTES = 1 << 25
"""What Python, Arrow and DuckDB take beside the data of a query, and each of DuckDB's threads."""


@dataclass(frozen=True)
class SqlLimits:
    """Time and memory of one SQL text; its answer may be as large as its memory."""

    seconds: float = 300.0
    memory_mb: float = 4096.0

    @property
    def memory_bytes(self) -> int:
        """The memory for data, in bytes."""
        return int(self.memory_mb * 1_000_000)

    @property
    def process_bytes(self) -> int:
        """The memory of the whole process, in bytes."""
        return self.memory_bytes + _BESIDE_BYTES + _THREAD_BYTES * (os.cpu_count() or 1)

    def out_of_time(self) -> LimitError:
        """The error of SQL that took too long."""
        return _error(f"it took longer than {self.seconds:g} s and was ended", "give it more with --time-limit")

    def out_of_memory(self) -> LimitError:
        """The error of SQL that took too much memory."""
        return _error(
            f"it took more than {self.memory_mb:g} MB of memory and was ended", "give it more with --memory-limit"
        )

    def answer_too_large(self) -> LimitError:
        """The error of SQL whose answer is too large."""
        return _error(
            f"its answer is larger than {self.memory_mb:g} MB and was ended", "ask for less: count, group, or LIMIT"
        )


def _error(problem: str, remedy: str) -> LimitError:
    return LimitError(problem, where="SQL", remedy=remedy)
