"""Recordings of the same moments: copies, growing files, and twins with other bytes."""

from pathlib import Path

from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT

INCIDENTS = ("query", "incidents", "--format", "json")
ATTACKED = record(WAGON, range(MOMENTS), attack=SPOT, seed=SEED)


def test_a_cleaned_twin_with_equal_stamps_does_not_take_the_place_of_the_attacked_one(audit: Audit, tmp_path: Path):
    log = write(tmp_path / "log.mcap", ATTACKED)
    assert audit.scan(log).code == Exit.FINDINGS
    write(log, record(WAGON, range(MOMENTS), seed=SEED))
    assert audit.scan(log).code in {Exit.INCOMPLETE, Exit.FINDINGS_INCOMPLETE}
    assert len(audit(*INCIDENTS).rows) == 1, "the attack that was found stays"


def test_an_attacked_twin_of_a_clean_recording_is_found(audit: Audit, tmp_path: Path):
    assert audit.scan(write(tmp_path / "clean.mcap", record(WAGON, range(MOMENTS), seed=SEED))).code == Exit.CLEAN
    assert audit.scan(write(tmp_path / "log.mcap", ATTACKED)).code in {Exit.FINDINGS, Exit.FINDINGS_INCOMPLETE}


def test_a_growing_file_gives_one_incident(audit: Audit, tmp_path: Path):
    log = tmp_path / "log.mcap"
    for end in (MOMENTS - 2, MOMENTS):
        write(log, [sent for sent in ATTACKED if sent.moment < end])
        assert audit.scan(log).code == Exit.FINDINGS
    [incident] = audit(*INCIDENTS).rows
    assert (incident["first_frame"], incident["last_frame"]) == (SPOT.moments.start, MOMENTS - 1)


def test_a_copy_under_another_name_gives_one_incident_and_both_names_are_kept(audit: Audit, tmp_path: Path):
    log = write(tmp_path / "log.mcap", ATTACKED)
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(log.read_bytes())
    assert audit.scan(log, copy).code == Exit.FINDINGS
    assert len(audit(*INCIDENTS).rows) == 1
    assert {"log.mcap", "copy.mcap"} <= set(
        str(audit.ask("FROM recordings")).replace("'", " ").replace("/", " ").split()
    )


def test_a_cut_copy_of_an_attacked_recording_does_not_hide_it(audit: Audit, tmp_path: Path):
    log = write(tmp_path / "log.mcap", ATTACKED)
    assert audit.scan(log).code == Exit.FINDINGS
    write(log, [sent for sent in ATTACKED if sent.moment < SPOT.moments.start])
    audit.scan(log)
    assert len(audit(*INCIDENTS).rows) == 1
