"""The memory of this process, from Linux's /proc."""

from pathlib import Path

_STATUS = Path("/proc/self/status")
_CLEAR_REFS = Path("/proc/self/clear_refs")


def memory_mb(name: str) -> float:
    """A figure of /proc/self/status, such as VmRSS, or VmHWM for the peak, in MB."""
    return int(_STATUS.read_text().split(f"{name}:")[1].split()[0]) / 1024


def forget_peak() -> None:
    """Start the peak anew at the present use."""
    _CLEAR_REFS.write_text("5")
