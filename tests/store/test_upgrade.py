"""A store of an earlier version is upgraded: it answers as before, whenever the upgrade may have been killed."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.cli import run
from auditor.errors import StoreError
from auditor.model.fault_features import COLUMNS
from auditor.model.measurement import COUNTING_VERSIONS
from auditor.pipeline import judge
from auditor.store.folder import UPGRADED, UPGRADED_FROM
from auditor.store.maintenance import upgrade
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_sql
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import read_rows
from tests.store.kept import answers, unpack

BEFORE = UPGRADED_FROM[-1]
RENAMED = {"single_frame": "alert"}
"""Columns of version 11, by what they are called now."""


class KilledError(BaseException):
    """Stands for a killed process: nothing catches it."""


@pytest.fixture
def old(tmp_path):
    """The folder of a store of the version before, and what it answered."""
    return unpack(BEFORE, tmp_path)


def of_what_was_told(found, told):
    """Answers without the columns and fields that were not there when they were told; means to the last bits."""
    if isinstance(told, float):
        return pytest.approx(found, rel=1e-12)
    if isinstance(told, dict):
        return {name: of_what_was_told(found[RENAMED.get(name, name)], value) for name, value in told.items()}
    if isinstance(told, list) and len(told) == len(found):
        return [of_what_was_told(one, value) for one, value in zip(found, told, strict=True)]
    return found


def content(folder):
    """What is in a folder, but for what an upgrade that was killed left there."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and UPGRADED not in path.parts)
    return {path: path.read_bytes() for path in files}


def test_a_store_of_this_version_answers_as_when_it_was_kept(tmp_path):
    folder, told = unpack(SCHEMA_VERSION, tmp_path)
    assert answers(folder) == told


@pytest.mark.parametrize("version", UPGRADED_FROM)
def test_an_upgraded_store_answers_of_what_was_told(tmp_path, version):
    folder, told = unpack(version, tmp_path)
    assert upgrade.upgrade(folder) == upgrade.UpgradeResult(measurements=2, judgements=4, parts=6)
    assert of_what_was_told(answers(folder), told) == told
    store = Store.open(folder)
    assert all(store.pictured_frames(known) for known in store.ids("measurements"))
    assert not (folder / UPGRADED).exists()


def test_an_upgrade_keeps_the_history_of_the_calibrations(old):
    folder, _ = old
    before = [table.to_pylist() for table in map(pq.read_table, sorted((folder / "calibration_history").iterdir()))]
    upgrade.upgrade(folder)
    paths = Store.open(folder).finished_paths("calibration_history")
    assert [read_rows("calibration_history", path) for path in paths] == before


def test_an_upgraded_store_that_was_counted_earlier_is_read_whole_and_refused_by_name(old, capfd, monkeypatch):
    folder, _ = old
    monkeypatch.setattr(judge, "COUNTING_VERSIONS", {one: version + 1 for one, version in COUNTING_VERSIONS.items()})
    upgrade.upgrade(folder)
    store = Store.open(folder)
    judged = store.ids("judgements")
    for known in store.ids("measurements"):
        assert np.isfinite(store.load_statistics(known).statistics).any()
        assert list(store.load_cells(known))
    assert run(["judge", str(folder), "-r", "0.02"]) == 2
    assert "measured by an earlier way of counting; measure again with auditor scan" in capfd.readouterr().err
    assert store.ids("judgements") == judged
    assert verify(store).problems == ()


@pytest.mark.parametrize("version", UPGRADED_FROM)
def test_what_was_looked_at_is_filled_in_and_what_casts_no_doubt_becomes_a_remark(tmp_path, version):
    folder, _ = unpack(version, tmp_path)
    thinned = "the points of the LiDAR /top lie so far apart, as where only some were recorded, that lost returns and"
    for path in (folder / "measurements").iterdir():
        table = pq.read_table(path)
        column = table.schema.get_field_index("calibration_warnings")
        said = pa.array([["a doubt", thinned]], table.schema.field(column).type)
        pq.write_table(table.set_column(column, table.schema.field(column), said), path)
    upgrade.upgrade(folder)
    store = Store.open(folder)
    assert {(one.calibration_warnings, one.remarks) for one in store.measurements()} == {(("a doubt",), (thinned,))}
    frames = run_sql(
        store,
        """SELECT measurement_id, sensor, count(*) FILTER (state = 'present') AS frames,
        avg(compared_share) FILTER (state = 'present') AS one_share FROM sensors GROUP BY ALL ORDER BY ALL""",
    ).to_pylist()
    looked = run_sql(
        store, "SELECT measurement_id, sensor, frames, 1 - none_share AS one_share FROM looked ORDER BY ALL"
    ).to_pylist()
    assert looked == [{**one, "one_share": pytest.approx(one["one_share"])} for one in frames]
    assert {one["one_share"] is None for one in frames} == {version < 12}


def test_cases_of_evaluations_keep_the_fault_features_that_are_judged(old):
    folder, _ = old
    pairs, kept = 3, {name: place for place, name in enumerate(COLUMNS)}
    [path, *_] = (folder / "cases").iterdir()
    before = pq.read_table(path)["fault_features"].to_pylist()
    upgrade.upgrade(folder)
    after = [row["fault_features"] for row in read_rows("cases", folder / "cases" / path.name)]
    for old_list, new in zip(before, after, strict=True):
        assert len(new) == pairs * len(COLUMNS)
        of_pair = len(old_list) // pairs
        for pair in range(pairs):
            assert new[pair * len(COLUMNS) + kept["row_aligned"]] == old_list[pair * of_pair + 1]
            assert new[pair * len(COLUMNS) + kept["isolated_near"]] == old_list[pair * of_pair + 17]


def test_columns_and_tables_that_the_old_store_lacks_are_null_and_empty(old):
    folder, _ = old
    for path in (folder / "frames").glob("*.parquet"):
        pq.write_table(pq.read_table(path).drop_columns(["level"]), path)
    shutil.rmtree(folder / "labels")
    upgrade.upgrade(folder)
    store = Store.open(folder)
    frames = [row for path in store.finished_paths("frames") for row in read_rows("frames", path)]
    assert {row["level"] for row in frames} == {None}
    assert any(row["gated_valid_px"] for row in frames)
    assert store.ids("labels") == []
    assert answers(folder)["summary"]


def test_a_store_of_the_version_before_is_refused_in_one_line_that_says_what_upgrades_it(old, capsys):
    folder, _ = old
    assert run(["query", "summary", "--store", str(folder)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert f"schema version {BEFORE}" in line
    assert f"auditor store upgrade {folder}" in line


def test_the_command_says_what_it_did_and_does_nothing_twice(old, capsys):
    folder, _ = old
    assert run(["store", "upgrade", str(folder)]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert "2 measurements, 4 judgements" in line
    upgraded = content(folder)
    assert run(["store", "upgrade", str(folder)]) == 0
    assert "already" in capsys.readouterr().err
    assert content(folder) == upgraded


@pytest.mark.parametrize("version", [1, min(UPGRADED_FROM) - 1, SCHEMA_VERSION + 1])
def test_other_versions_are_neither_opened_nor_upgraded(tmp_path, version):
    (tmp_path / "store.json").write_text(json.dumps({"format": "auditor store", "schema_version": version}))
    remedy = "measure again" if version < SCHEMA_VERSION else "use the auditor that wrote it"
    for use in (Store.open, upgrade.upgrade):
        with pytest.raises(StoreError, match=f"schema version {version}.*{remedy}"):
            use(tmp_path)


@pytest.mark.parametrize("killed_at", [0, 39])
def test_an_upgrade_that_is_killed_while_it_writes_leaves_the_old_store_as_it_was(old, monkeypatch, killed_at):
    folder, told = old
    before, write_rows, written = content(folder), upgrade.write_rows, []

    def killed(*given):
        if len(written) == killed_at:
            raise KilledError
        written.append(given)
        return write_rows(*given)

    monkeypatch.setattr(upgrade, "write_rows", killed)
    with pytest.raises(KilledError):
        upgrade.upgrade(folder)
    monkeypatch.undo()
    assert content(folder) == before
    upgrade.upgrade(folder)
    assert of_what_was_told(answers(folder), told) == told


@pytest.mark.parametrize("function", ["rename", "rmtree"])
@pytest.mark.parametrize("killed_at", [0, 12])
def test_an_upgrade_that_is_killed_while_it_replaces_files_is_completed_by_whoever_opens_it(
    old, monkeypatch, function, killed_at
):
    folder, told = old
    owner = Path if function == "rename" else shutil
    original, done = getattr(owner, function), []

    def killed(path, *given, **named):
        if (folder / "store.json").read_text().count("moving"):
            if len(done) == killed_at:
                raise KilledError
            done.append(path)
        return original(path, *given, **named)

    monkeypatch.setattr(owner, function, killed)
    with pytest.raises(KilledError):
        upgrade.upgrade(folder)
    monkeypatch.undo()
    assert of_what_was_told(answers(folder), told) == told
    assert not (folder / UPGRADED).exists()
