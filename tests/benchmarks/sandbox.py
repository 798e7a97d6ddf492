"""All attempts of SQL to write or to read outside, each in its process: `python -m tests.benchmarks.sandbox`.

To try another DuckDB: `pip install --target FOLDER --no-deps duckdb==1.4.0`, and FOLDER first in PYTHONPATH.
"""

import tempfile
from hashlib import sha256
from pathlib import Path

import duckdb

from auditor.errors import AuditorError
from auditor.store.sandbox.process import run_sandboxed
from auditor.store.sandbox.read_only_files import name_of
from tests.making.sandbox_attempts import REFUSED
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store, rig = new_store(folder), make_rig(3)
        add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)]), "c1u")
        [finished] = store.finished_paths("verdicts")
        paths = {
            "out": folder / "out.parquet",
            "secret": folder / "secret.txt",
            "inside": finished.with_name("unfinished.parquet"),
            "finished": finished,
            "known": name_of(finished, finished.stat()),
            "folder": folder,
        }
        paths["secret"].write_text("secret,words\n1,2\n")
        paths["inside"].write_bytes(finished.read_bytes())
        before, failed = tree(folder), 0
        for text in REFUSED:
            outcome = attempt(store, text.format(**paths))
            if len(outcome.splitlines()) != 1 or "Traceback" in outcome or tree(folder) != before:
                failed += 1
                print(f"{text}\n    {outcome or 'answered'}, the folder is {tree(folder) == before or 'changed'}")
        print(f"DuckDB {duckdb.__version__}: {len(REFUSED)} attempts, {failed} not refused in one line")


def attempt(store, text):
    """The error of an attempt; empty where it was answered."""
    try:
        run_sandboxed(store, text + "\n-- rigs")
    except AuditorError as error:
        return str(error)
    return ""


def tree(folder):
    return {path: path.is_file() and sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*")}


if __name__ == "__main__":
    main()
