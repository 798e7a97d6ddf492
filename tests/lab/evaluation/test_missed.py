"""Pictures of what an evaluation missed."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from auditor.lab.attacks.faults import HiddenSector
from auditor.lab.attacks.paper import Facula
from auditor.lab.evaluation import (
    EvaluateTask,
    RecordingSource,
    evaluate_source,
    judge_cases,
    keep_missed,
    missed,
    runner,
)
from auditor.lab.evaluation.experiments import EXPERIMENTS, AttackCase, Experiment, all_triples
from auditor.measurement.drawing.clouds import small_jpeg
from auditor.reporting.evaluation.loading import NOT_KEPT, load_evaluation, missed_attacks, render_evaluation
from auditor.store.evaluation_tables import case_key, missed_pictures
from auditor.store.maintenance.removal import remove_recordings
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_query
from auditor.store.store import Store
from tests.making.pages import Page
from tests.making.scenes import plane_rig
from tests.making.small_drives import THREE_CAMERAS, drive_frames, write_drive

FRAMES = 3
WEAK = {radius: Facula(30.0, radius, u_px=100.0, v_px=60.0) for radius in (3.0, 5.0)}
OPAQUE = Facula(2000.0, 60.0, u_px=160.0, v_px=60.0)
SECTOR = HiddenSector(1.0, 10.0)


def few_cases(_rig, _draws, _past):
    """Faculas of a few pixels and a sector of few points, which nothing notices, and one facula that is seen."""
    for radius, facula in WEAK.items():
        yield AttackCase({1: facula}, size=radius)
    yield AttackCase({0: SECTOR}, size=SECTOR.width_deg)
    yield AttackCase({2: OPAQUE}, "opaque")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drive") / "clean.mcap", FRAMES, positions_m=THREE_CAMERAS)


@pytest.fixture(scope="module", autouse=True)
def few_attacks():
    """The clean frames and few attacks are all that is tried."""
    tried = (EXPERIMENTS[0], Experiment("further", all_triples, few_cases))
    with pytest.MonkeyPatch.context() as patched:
        for module in (runner, missed):
            patched.setattr(module, "experiments_of", lambda _: tried)
        yield


@pytest.fixture(scope="module")
def store(drive, tmp_path_factory):
    """A judged evaluation, and the sources of its recordings."""
    folder = tmp_path_factory.mktemp("store")
    done = evaluate_source(EvaluateTask(RecordingSource(drive), folder), lambda what, frames: None)
    kept = Store.open(folder)
    judge_cases(kept)
    return kept, dict.fromkeys(done.recordings, RecordingSource(drive))


@pytest.fixture(scope="module")
def page(store):
    """The text of the page with other attacks that were missed, and its pictures."""
    whole = load_evaluation(store[0])

    def render(attacks):
        rendered = Page(render_evaluation(replace(whole, missed=tuple(attacks))))
        return rendered.text, [attributes for tag, attributes in rendered.elements if tag == "img"]

    return render


def pictured(store):
    return [(one.image is not None, one.reason) for one in missed_attacks(store)]


def test_the_strongest_of_each_kind_and_sensor_is_shown_as_it_was_attacked(store, page):
    kept, sources = store
    keep_missed(kept, sources)
    chosen = run_query(kept, "evaluation_missed", {}).to_pylist()
    assert [(row["attack"], row["attacked"], row["size"], row["frame"]) for row in chosen] == [
        ("facula", [1], 5.0, 0),
        ("hidden sector", [0], SECTOR.width_deg, 0),
    ]
    assert all(row["largest_z"] < row["limit_z"] for row in chosen)
    on_camera, on_lidar = (missed_pictures(kept)[case_key(row)].jpeg for row in chosen)
    clean = next(iter(drive_frames(plane_rig(THREE_CAMERAS), FRAMES))).images[1]
    assert on_camera == small_jpeg(WEAK[5.0].apply(clean).pixels) != small_jpeg(clean.pixels)
    assert cv2.imdecode(np.frombuffer(on_lidar, np.uint8), cv2.IMREAD_COLOR).shape == (640, 640, 3)
    text, images = page(missed_attacks(kept))
    assert [one["alt"][:23] for one in images] == ["Facula, R = 5 px on S_1", "Hidden sector, 1° on S_"]
    assert all(one["src"].startswith("data:image/jpeg;base64,") for one in images)
    assert f"limit {chosen[0]['limit_z']:.2f}" in text


def test_the_log_knows_the_pictures_and_what_has_one_is_not_read_again(store, monkeypatch):
    kept, sources = store
    keep_missed(kept, sources)
    before = missed_pictures(kept)
    monkeypatch.setattr(missed, "take_pictures", None)
    keep_missed(kept, {})
    assert missed_pictures(kept) == before
    assert not verify(kept).problems
    assert verify(kept).problems == ()
    (path,) = (kept.folder / "missed_pictures").iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    assert [problem.place for problem in verify(kept).grave] == [f"missed_pictures/{path.name}"]
    path.write_bytes(whole)


def test_the_pictures_go_with_their_recording(store, tmp_path):
    kept, sources = store
    keep_missed(kept, sources)
    copy = Store.open(shutil.copytree(kept.folder, tmp_path / "copy"))
    remove_recordings(copy, sources)
    assert missed_pictures(copy) == {}
    assert not verify(copy).problems
    assert missed_pictures(kept)


def test_the_page_says_why_there_is_no_picture(store, page, monkeypatch):
    kept, sources = store
    for path in (kept.folder / "missed_pictures").glob("*"):  # as in a store of before there were any
        path.unlink()
    assert pictured(kept) == [(False, NOT_KEPT)] * 2
    keep_missed(kept, {})
    assert pictured(kept) == [(False, missed.NOT_HERE)] * 2
    keep_missed(kept, dict.fromkeys(sources, RecordingSource(kept.folder / "gone.mcap")))
    assert all(reason not in ("", NOT_KEPT, missed.NOT_HERE) for _, reason in pictured(kept))
    monkeypatch.setitem(WEAK, 5.0, Facula(31.0, 5.0, u_px=100.0, v_px=60.0))
    keep_missed(kept, sources)
    assert pictured(kept) == [(False, missed.NOT_AGAIN), (True, "")]
    text, images = page(missed_attacks(kept))
    assert f"No picture: {missed.NOT_AGAIN}." in text
    assert len(images) == 1


def test_where_nothing_was_missed_the_page_says_so(page):
    text, images = page(())
    assert "Nothing: no attacked sensor was taken for clean" in text
    assert not images
