"""What the check of wheels says of one that lacks its weights, or has others."""

import zipfile
from pathlib import Path

import pytest

from tests.wheel import WEIGHTS, faults

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("content", [None, b"others"], ids=["missing", "other ones"])
@pytest.mark.parametrize("name", WEIGHTS)
def test_a_wheel_without_the_weights_is_at_fault(name: str, content: bytes | None, tmp_path: Path) -> None:
    found = faults(wheel_with({name: content} if content is not None else {}, tmp_path), ROOT)
    assert f"missing or another: {name}" in found


def test_a_wheel_with_them_is_not_at_fault_for_them(tmp_path: Path) -> None:
    found = faults(wheel_with({name: (ROOT / name).read_bytes() for name in WEIGHTS}, tmp_path), ROOT)
    assert not [fault for fault in found if "safetensors" in fault or "too large" in fault]


def wheel_with(weights: dict[str, bytes], folder: Path) -> Path:
    path = folder / "auditor.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("auditor/__init__.py", "")
        for name, content in weights.items():
            archive.writestr(name, content)
    return path
