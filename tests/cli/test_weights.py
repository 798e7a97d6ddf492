from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

from auditor.cli import run  # noqa: E402 - torch first: without it there is nothing to test
from auditor.measurement.disparity.matchers.psmnet.network import PSMNet  # noqa: E402


def test_a_checkpoint_is_looked_into_and_converted(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    checkpoint, safe = tmp_path / "model.tar", tmp_path / "model.safetensors"
    network = PSMNet(max_disparity=64, align_corners=True, width=8)
    torch.save({"state_dict": {f"module.{k}": v for k, v in network.state_dict().items()}, "epoch": 3}, checkpoint)
    assert run(["weights", "inspect", str(checkpoint)]) == 0
    assert "align_corners  -" in capfd.readouterr().out
    assert run(["weights", "convert", str(checkpoint), str(safe)]) == 2
    assert "align" in capfd.readouterr().err
    assert run(["weights", "convert", str(checkpoint), str(safe), "--align-corners", "--max-disparity", "64"]) == 0
    assert run(["weights", "inspect", str(safe)]) == 0
    assert "align_corners  yes" in capfd.readouterr().out


def test_what_is_no_checkpoint_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.tar").write_bytes(b"not a checkpoint")
    assert run(["weights", "inspect", str(tmp_path / "model.tar")]) == 2
    assert "model.tar" in capfd.readouterr().err
