"""Writers: frames become MCAP files, .bag files and rosbag2 folders, by the packages mcap and rosbags."""

from auditor.recordings.writers.frames import write_bag, write_db3, write_mcap

__all__ = ["write_bag", "write_db3", "write_mcap"]
