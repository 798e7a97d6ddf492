"""`auditor show`: any frame, as a table and as pictures."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.making.audits import Audit
from tests.making.case_stores import AttackedStore, recorded_frames


@pytest.fixture
def audit(attacked: AttackedStore, capfdbinary: pytest.CaptureFixture[bytes]) -> Audit:
    return Audit(attacked.folder, capfdbinary.readouterr)


def test_a_frame_is_shown_with_its_verdict_and_written_without_loss(
    audit: Audit, attacked: AttackedStore, tmp_path: Path
) -> None:
    frame = attacked.row(0)["strongest_frame"]
    answer = audit("show", attacked.recordings[0], frame, "--into", tmp_path / "frame")
    text = answer.out.decode()
    assert answer.code == 0
    assert "verdict attacked S_0" in text
    assert "320 x 120" in text
    names = {path.name for path in (tmp_path / "frame").iterdir()}
    assert names >= {f"{frame}_{name}" for name in ("S0.above.png", "S0.range.png", "S1.colour.png", "S4.overlay.png")}
    assert f"{frame}.place.svg" in names
    recorded = recorded_frames(attacked.recordings[0])[frame]
    for sensor, image in recorded.images.items():
        written = cv2.imread(str(tmp_path / "frame" / f"{frame}_S{sensor}.colour.png"), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(np.asarray(written), image.pixels)
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "frame").iterdir()} == {0o600}


def test_a_frame_that_no_store_knows_is_measured_now(audit: Audit, attacked: AttackedStore, tmp_path: Path) -> None:
    answer = Audit(tmp_path / "none", audit._printed)("show", attacked.recordings[2], 8)
    assert answer.code == 0
    assert "no verdict: the store has not measured it" in answer.out.decode()
    [line] = [one for one in answer.out.decode().splitlines() if one.strip().startswith("S_2")]
    assert line.split()[-1] == "%"  # the white part is found


def test_what_cannot_be_shown_is_one_line(audit: Audit, attacked: AttackedStore, tmp_path: Path) -> None:
    beyond = audit("show", attacked.recordings[0], 1000)
    assert (beyond.code, "it has no frame 1000" in beyond.err) == (2, True)
    there = audit("show", attacked.recordings[0], 1, "--into", tmp_path)
    assert (there.code, "exists already" in there.err) == (2, True)
