"""What processes of recordings are forked with: made once, and not again in each."""

from pathlib import Path

from auditor.measurement.checks.found import measuring_digest
from auditor.model import parameters
from auditor.model.rig_kind import ComparedTo
from auditor.pipeline.measure import library_versions
from auditor.pipeline.workers import Limits, run_within
from auditor.store.schema import TABLES, table_schema

MADE = (table_schema, library_versions, parameters._canonical_values)


def made_anew(_: Path) -> list[int]:
    """How often a process of a recording makes each of them."""
    before = [one.cache_info().misses for one in MADE]
    for table in TABLES:
        table_schema(table)
    library_versions()
    for compared_to in ComparedTo:
        measuring_digest(compared_to)
    return [one.cache_info().misses - there for one, there in zip(MADE, before, strict=True)]


def test_a_process_reads_no_description_of_tables_and_no_version_again(tmp_path: Path) -> None:
    assert run_within(Limits(), made_anew, tmp_path) == [0, 0, 0]
