"""The digests of all parameters, by version; run as a program it keeps those of the present versions.

    python -m tests.digests

A version that was published keeps its digest: raise the version first.
"""

import tomllib
from pathlib import Path
from typing import Any

from auditor.identification.parameters import FittedOn, judging_digest
from auditor.measurement.checks.found import measuring_digest
from auditor.model.measurement import COUNTING_VERSIONS
from auditor.model.rig_kind import ComparedTo
from auditor.model.verdict import JUDGING_VERSION
from auditor.recordings.parameters import synchronising_digest

KEPT = Path(__file__).with_suffix(".toml")


def counting(compared_to: ComparedTo) -> list[str]:
    """The digests of what measures such rigs and of what synchronises."""
    return [measuring_digest(compared_to), synchronising_digest()]


def judging() -> list[str]:
    """The digest of what judges."""
    return [judging_digest()]


def judging_psmnet() -> list[str]:
    """The digest of what judges by the prior of the network that comes with auditor."""
    return [judging_digest(FittedOn.PSMNET)]


def read() -> dict[str, Any]:
    """By what is compared, or "judging", and by version, the digests that were kept."""
    return tomllib.loads(KEPT.read_text())


def _write() -> None:
    kept = read()
    for compared_to, version in COUNTING_VERSIONS.items():
        kept[compared_to][str(version)] = counting(compared_to)
    kept["judging"][str(JUDGING_VERSION)] = judging()
    kept["judging_psmnet"][str(JUDGING_VERSION)] = judging_psmnet()
    sections = (
        f"[{name}]\n" + "".join(f"{version} = {digests}\n" for version, digests in of_versions.items())
        for name, of_versions in kept.items()
    )
    KEPT.write_text("\n".join(sections).replace("'", '"'))


if __name__ == "__main__":
    _write()
