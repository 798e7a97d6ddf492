"""Small stores that were kept with what they answered, one folder a schema version: `python -m tests.store.kept`.

That keeps one of today's version: a clean and an attacked recording, judged by both methods, and an evaluation.
"""

import json
import tarfile
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from auditor.cli import run
from auditor.store.queries import run_query, run_sql
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

KEPT = Path(__file__).parent / "kept_stores"

Answers = Mapping[str, list[dict[str, Any]]]


def unpack(version: int, folder: Path) -> tuple[Path, Answers]:
    """The kept store of a version, unpacked into a folder, and what it answered."""
    place = KEPT / f"version_{version}"
    with tarfile.open(place / "store.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    return folder / "audit", json.loads((place / "answers.json").read_text(encoding="utf-8"))


def answers(folder: Path) -> Answers:
    """What a store answers, as JSON has it."""
    store = Store.open(folder)
    tables = {
        "summary": run_query(store, "summary"),
        "incidents": run_query(store, "incidents"),
        "verdicts": run_sql(store, "SELECT * FROM stored_verdicts ORDER BY judgement_id, frame"),
        "evaluation": run_query(store, "evaluation_summary"),
    }
    rows = {name: table.to_pylist() for name, table in tables.items()}
    return json.loads(json.dumps(rows, default=str))  # type: ignore[no-any-return]


def keep() -> None:
    """Keep a store of today's version."""
    place = KEPT / f"version_{SCHEMA_VERSION}"
    place.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        clean, attacked, audit = (Path(folder) / name for name in ("clean.mcap", "attacked.mcap", "audit"))
        write_drive(clean, 10, seed=1, positions_m=THREE_CAMERAS)
        later_ns = START_NS + 60 * 10**9
        write_drive(attacked, 10, seed=1, positions_m=THREE_CAMERAS, start_ns=later_ns, attacked={2: range(3, 8)})
        for words in (
            ("calibrate", clean, "-r", 0),
            ("scan", attacked, "-r", 0.01),
            ("evaluate", clean, "--attack-every", 10),
        ):
            run([*map(str, words), "--store", str(audit), "--jobs", "1"])
        for method, r in (("paper", "0"), ("robust", "0.01")):
            run(["judge", str(audit), "--method", method, "-r", r])
        (place / "answers.json").write_text(json.dumps(answers(audit)) + "\n", encoding="utf-8")
        with tarfile.open(place / "store.tar.xz", "w:xz") as archive:
            archive.add(audit, "audit", filter=_without_owner)


def _without_owner(member: tarfile.TarInfo) -> tarfile.TarInfo:
    return member.replace(uid=0, gid=0, uname="", gname="", mtime=0, deep=False)


if __name__ == "__main__":
    keep()
