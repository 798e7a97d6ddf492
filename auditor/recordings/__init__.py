"""READ: a file becomes messages, and messages become frames."""

from auditor.recordings.converting import ConvertReport, convert, rewrite
from auditor.recordings.finding import Found, find_recordings
from auditor.recordings.health import Health, look_through
from auditor.recordings.interface import Damage, Reader, Recording, Topic
from auditor.recordings.opening import format_of, open_recording
from auditor.recordings.origin import Origin
from auditor.recordings.path_pattern import read_path
from auditor.recordings.rig_file import read_rig, write_rig
from auditor.recordings.rigs import (
    FoundRigs,
    check_rig,
    check_rig_file,
    find_rigs,
    look_for_rigs,
    rig_of_camchain,
    told_rig,
)
from auditor.recordings.surveying import Survey, survey
from auditor.recordings.synchronising import FrameStream, synchronise
from auditor.recordings.writers import write_bag, write_db3, write_mcap

__all__ = [
    "ConvertReport",
    "Damage",
    "Found",
    "FoundRigs",
    "FrameStream",
    "Health",
    "Origin",
    "Reader",
    "Recording",
    "Survey",
    "Topic",
    "check_rig",
    "check_rig_file",
    "convert",
    "find_recordings",
    "find_rigs",
    "format_of",
    "look_for_rigs",
    "look_through",
    "open_recording",
    "read_path",
    "read_rig",
    "rewrite",
    "rig_of_camchain",
    "survey",
    "synchronise",
    "told_rig",
    "write_bag",
    "write_db3",
    "write_mcap",
    "write_rig",
]
