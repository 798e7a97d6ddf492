"""What the check of wheels says of one that lacks its weights, or has others."""

import zipfile
from pathlib import Path

import pytest

from tests.wheel import WEIGHTS, faults

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("content", [None, b"others"], ids=["missing", "other ones"])
def test_a_wheel_without_the_weights_is_at_fault(content: bytes | None, tmp_path: Path) -> None:
    assert f"missing or another: {WEIGHTS}" in faults(wheel_with(content, tmp_path), ROOT)


def test_a_wheel_with_them_is_not_at_fault_for_them(tmp_path: Path) -> None:
    found = faults(wheel_with((ROOT / WEIGHTS).read_bytes(), tmp_path), ROOT)
    assert not [fault for fault in found if "weights" in fault or WEIGHTS in fault or "too large" in fault]


def wheel_with(weights: bytes | None, folder: Path) -> Path:
    path = folder / "auditor.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("auditor/__init__.py", "")
        if weights is not None:
            archive.writestr(WEIGHTS, weights)
    return path
