"""The digests of all parameters, by version; run as a program it keeps those of the present versions.

    python -m tests.digests

A version that was published keeps its digest: raise the version first.
"""

import tomllib
from pathlib import Path
from typing import Any

from auditor.identification.parameters import judging_digest
from auditor.measurement.parameters import measuring_digest
from auditor.model.measurement import COUNTING_VERSION
from auditor.model.verdict import JUDGING_VERSION
from auditor.recordings.parameters import synchronising_digest

KEPT = Path(__file__).with_suffix(".toml")


def counting() -> list[str]:
    """The digests of what measures and of what synchronises."""
    return [measuring_digest(), synchronising_digest()]


def judging() -> list[str]:
    """The digest of what judges."""
    return [judging_digest()]


def read() -> dict[str, Any]:
    """By "counting" and "judging", and by version, the digests that were kept."""
    return tomllib.loads(KEPT.read_text())


def _write() -> None:
    kept = read()
    kept["counting"][str(COUNTING_VERSION)] = counting()
    kept["judging"][str(JUDGING_VERSION)] = judging()
    sections = (
        f"[{name}]\n" + "".join(f"{version} = {digests}\n" for version, digests in of_versions.items())
        for name, of_versions in kept.items()
    )
    KEPT.write_text("\n".join(sections).replace("'", '"'))


if __name__ == "__main__":
    _write()
