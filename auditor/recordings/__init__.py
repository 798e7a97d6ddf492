"""READ: the messages of a recording, its rigs, and its frames in order of time."""

from auditor.recordings.location import Location, Origin, located, read_path
from auditor.recordings.opening import LocatedRecordings, find_recordings, format_of, open_recording
from auditor.recordings.recording import Damage, Reader, Recording, Topic
from auditor.recordings.rigs.calibrations import Positions, ZeroLens
from auditor.recordings.rigs.cameras import read_by, zero_lenses
from auditor.recordings.rigs.changes import Changes
from auditor.recordings.rigs.discovery import (
    FoundRigs,
    check_rig,
    check_rig_file,
    find_rigs,
    given_rig,
    rig_of_yaml,
    search_rigs,
)
from auditor.recordings.rigs.files import read_rig, write_rig
from auditor.recordings.rigs.frame_tree import rig_places, unused_lidars
from auditor.recordings.rigs.in_force import RigInForce, RigsInForce, rigs_in_force, rigs_unless_changed
from auditor.recordings.rigs.ordering import Contradictions, contradictions
from auditor.recordings.synchronisation.coverage import outside_topics
from auditor.recordings.synchronisation.frames import FrameStream, synchronise
from auditor.recordings.synchronisation.poses import FramePoses, FrameTimes, PoseMessages, read_poses
from auditor.recordings.synchronisation.streams import (
    FarAheadError,
    Health,
    Listener,
    check_health,
    in_turn,
    share_a_read,
)
from auditor.recordings.synchronisation.survey import Survey, survey
from auditor.recordings.writers.convert import ConvertReport, convert, rewrite
from auditor.recordings.writers.frames import write_bag, write_db3, write_mcap

__all__ = [
    "Changes",
    "Contradictions",
    "ConvertReport",
    "Damage",
    "FarAheadError",
    "FoundRigs",
    "FramePoses",
    "FrameStream",
    "FrameTimes",
    "Health",
    "Listener",
    "LocatedRecordings",
    "Location",
    "Origin",
    "PoseMessages",
    "Positions",
    "Reader",
    "Recording",
    "RigInForce",
    "RigsInForce",
    "Survey",
    "Topic",
    "ZeroLens",
    "check_health",
    "check_rig",
    "check_rig_file",
    "contradictions",
    "convert",
    "find_recordings",
    "find_rigs",
    "format_of",
    "given_rig",
    "in_turn",
    "located",
    "open_recording",
    "outside_topics",
    "read_by",
    "read_path",
    "read_poses",
    "read_rig",
    "rewrite",
    "rig_of_yaml",
    "rig_places",
    "rigs_in_force",
    "rigs_unless_changed",
    "search_rigs",
    "share_a_read",
    "survey",
    "synchronise",
    "unused_lidars",
    "write_bag",
    "write_db3",
    "write_mcap",
    "write_rig",
    "zero_lenses",
]
