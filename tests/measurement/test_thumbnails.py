import cv2
import numpy as np
import pytest

from auditor.measurement import PictureBook, draw, measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.measurement import Counts, Measurement
from auditor.model.pictures import Pictures
from tests.making.scenes import HEIGHT, WIDTH, plane_frame, plane_rig


def test_a_picture_shows_every_camera_and_marks_what_is_inconsistent() -> None:
    rig = plane_rig()
    frame = plane_frame(rig)
    frame.images[2].pixels[:, WIDTH // 2 :] = 255
    picture = draw(measure(frame, rig, SgbmMatcher())[1], frame.number)
    assert picture is not None
    assert picture.reference == 3
    views = {n: cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE) for n, jpeg in picture.views.items()}
    assert {n: view.shape for n, view in views.items()} == dict.fromkeys((1, 2, 3), (HEIGHT // 2, WIDTH // 2))
    assert views[2][:, WIDTH // 4 + 4 :].min() > 240
    mask = cv2.imdecode(np.frombuffer(picture.mask_png, np.uint8), cv2.IMREAD_UNCHANGED)
    marked = mask[:, :, 3] > 0
    assert marked[:, 3 * WIDTH // 8 :].mean() > 0.5
    assert marked[:, 20 : WIDTH // 8].mean() < 0.05


def test_there_is_no_picture_where_nothing_was_measured() -> None:
    rig = plane_rig()
    _, evidence = measure(plane_frame(rig, without=frozenset({1, 2})), rig, SgbmMatcher())
    assert not evidence.comparisons
    assert draw(evidence, 0) is None


def test_a_picture_book_keeps_the_strongest_frame_of_each_second_and_the_strongest_seconds(monkeypatch) -> None:
    monkeypatch.setattr("auditor.measurement.thumbnails._MOST_PICTURES", 2)
    rig = plane_rig()
    _, evidence = measure(plane_frame(rig), rig, SgbmMatcher())
    book = PictureBook()
    offers = [(0, 0.1, 10), (0, 0.9, 30), (0, 0.5, 20), (1, 0.2, 40), (2, 0.3, 90), (3, 0.1, 50)]
    for second, strength, inconsistent in offers:
        counts = Counts(1000, 0, 1000, inconsistent * 10, 0)
        number = round(second * 10 + strength * 10)
        book.offer(Measurement(number, round((second + strength) * 1e9), {}, (counts,), {}), evidence)
    assert [picture.frame for picture in book.pages()] == [23, 31]


@pytest.mark.parametrize(("pictures", "kept"), [("none", []), ("incidents", [1]), ("all", [0, 1, 5])])
def test_pictures_are_kept_of_none_of_unusual_or_of_all_frames(pictures, kept) -> None:
    rig = plane_rig()
    _, evidence = measure(plane_frame(rig), rig, SgbmMatcher())
    book = PictureBook(Pictures(pictures))
    for second in (0, 1, 2, 5):
        measurement = Measurement(second, second * 10**9, {}, (Counts(1000, 0, 1000, 100, 0),), {})
        book.offer(measurement, evidence, unusual=second == 1)
    assert [picture.frame for picture in book.pages()] == kept
