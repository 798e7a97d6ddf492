"""Whoever installs auditor alone has no pandas: scan, query and report do without it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from auditor.cli.exit_codes import Exit
from tests.making.logs_of_strangers import record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT

VERBS = """
import sys
from auditor.cli import run
if __name__ == "__main__":
    log, store = sys.argv[1:]
    codes = [run(["scan", log, "--pictures", "none", "--store", store])]
    for form in ("table", "csv", "json", "parquet"):
        codes.append(run(["query", "incidents", "--format", form, "--store", store]))
    codes.append(run(["report", "--store", store]))
    print([int(code) for code in codes], file=sys.stderr)
"""


def test_scan_query_and_report_run_where_pandas_cannot_be_imported(calibrated: Path, tmp_path: Path) -> None:
    blocked, program, store = tmp_path / "blocked", tmp_path / "verbs.py", tmp_path / "audit"
    blocked.mkdir()
    (blocked / "pandas.py").write_text("raise ModuleNotFoundError('No module named pandas', name='pandas')\n")
    program.write_text(VERBS)
    shutil.copytree(calibrated, store)
    log = write(tmp_path / "log.mcap", record(WAGON, range(MOMENTS), attack=SPOT, seed=SEED))
    path = os.pathsep.join([str(blocked), os.environ.get("PYTHONPATH", str(Path(__file__).parents[2]))])
    done = subprocess.run(
        [sys.executable, str(program), str(log), str(store)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        check=True,
    )
    *_, codes = done.stderr.decode().splitlines()
    assert codes == str([int(Exit.FINDINGS), *[int(Exit.CLEAN)] * 5]), done.stderr
    assert done.stdout.count(b"2011-09-26T13:02:26.") >= 3, "pandas alone has a type for nanoseconds"
