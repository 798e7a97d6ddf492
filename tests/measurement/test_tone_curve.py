import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.measurement.tone_curve import chroma_classes, predict, saturates_from, saturation_level

LEVELS = np.arange(256, dtype=np.uint8)


def fitted(source, target, usable=None):
    usable = np.ones(source.size, dtype=np.bool_) if usable is None else usable
    return predict(source, target, usable).table[0].astype(int)


def samples(count=4000, low=10, high=240, seed=0):
    return np.random.default_rng(seed).integers(low, high, count).astype(np.uint8)


def rounded(levels):
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255)), min_size=60, max_size=300), st.integers(1, 6))
@settings(max_examples=60, deadline=None)
def test_a_curve_never_falls_whatever_the_samples_are(pairs, times):
    source, target = np.repeat(np.array(pairs, dtype=np.uint8), times, axis=0).T
    assert (np.diff(fitted(source, target)) >= 0).all()


def test_of_too_few_samples_levels_are_taken_to_be_equal():
    few = np.repeat(np.array([40, 80, 160], np.uint8), 14)  # fourteen a bin, one too few
    assert fitted(few, 255 - few).tolist() == list(range(256))
    one_bin = np.full(5000, 100, np.uint8)
    assert fitted(one_bin, one_bin // 2).tolist() == list(range(256))
    nothing = np.zeros(0, np.uint8)
    assert fitted(nothing, nothing).tolist() == list(range(256))


@pytest.mark.parametrize(
    "response",
    [
        lambda x: 0.6 * x,
        lambda x: 1.05 * x,
        lambda x: 30 + 0.7 * x,
        lambda x: 255 * (x / 255) ** 0.5,
        lambda x: 255 * (x / 255) ** 2.2,
        lambda x: np.minimum(x, 120 + 0.3 * (x - 120)),
    ],
    ids=["gain below one", "gain above one", "offset", "gamma 0.5", "gamma 2.2", "knee"],
)
def test_a_rising_response_is_followed_where_there_are_samples(response):
    source = samples()
    expected = np.clip(response(LEVELS.astype(float)), 0, 255)
    # Within a bin of eight levels the curve is straight.
    assert np.abs(fitted(source, rounded(response(source.astype(float)))) - expected)[16:236].max() <= 4


def test_beyond_the_samples_the_outermost_gain_goes_on():
    source = samples(low=80, high=120)
    curve = fitted(source, source // 2)
    assert curve[[0, 20, 40]] == pytest.approx([0, 10, 20], abs=1)
    assert curve[[160, 200, 250]] == pytest.approx([80, 100, 125], abs=2)
    assert fitted(source, source * 2)[[140, 250]] == pytest.approx([255, 255], abs=1)


def test_other_materials_in_a_quarter_of_the_samples_do_not_move_a_curve():
    source = samples()
    target = source.copy()
    target[::4] = 255
    assert np.abs(fitted(source, target) - LEVELS)[16:230].max() <= 3


def test_samples_that_are_not_usable_do_not_count():
    source = samples()
    target = source.copy()
    usable = np.arange(source.size) % 2 == 0
    target[~usable] = 0
    np.testing.assert_array_equal(fitted(source, target, usable), fitted(source[usable], source[usable]))


def materials(count=6000, seed=2):
    """Luma, grey level and class of two materials: foliage looks twice as bright to a grey camera as cloth."""
    rng = np.random.default_rng(seed)
    luma, foliage = rng.integers(20, 110, count).astype(np.uint8), rng.random(count) < 0.5
    return luma, np.where(foliage, luma * 2, luma).astype(np.uint8), np.where(foliage, 3, 20).astype(np.uint8)


def test_classes_of_chroma_predict_grey_levels_that_one_curve_cannot():
    luma, grey, classes = materials()
    usable = np.ones(luma.size, dtype=np.bool_)
    by_class = predict(luma, grey, usable, classes).of(luma, classes)
    together = predict(luma, grey, usable).of(luma[None])[0]
    assert np.abs(by_class.astype(int) - grey).max() <= 6
    assert np.abs(together.astype(int) - grey).max() > 30


def test_a_class_of_few_samples_has_the_curve_of_all():
    luma, grey, classes = materials()
    usable = np.ones(luma.size, dtype=np.bool_)
    classes[:149] = 7
    tables = predict(luma, grey, usable, classes).table
    np.testing.assert_array_equal(tables[7], predict(luma, grey, usable).table[0])
    classes[149] = 7
    assert (predict(luma, grey, usable, classes).table[7] != tables[7]).any()


def test_predictions_are_looked_up_by_class_and_level():
    luma, grey, classes = materials()
    prediction = predict(luma, grey, np.ones(luma.size, dtype=np.bool_), classes)
    picture, of_pixels = np.array([[60, 60], [30, 90]], np.uint8), np.array([[3, 20], [20, 3]], np.uint8)
    expected = [
        [prediction.table[3, 60], prediction.table[20, 60]],
        [prediction.table[20, 30], prediction.table[3, 90]],
    ]
    assert prediction.of(picture, of_pixels).tolist() == expected


def test_classes_are_how_much_red_and_blue_exceed_green():
    b, g, r = (np.array([level], np.uint8) for level in ([100] * 5, [100] * 5, [40, 80, 100, 120, 200]))
    reds = chroma_classes(b, g, r)
    assert reds.tolist() == [[2, 7, 12, 17, 22]]  # five classes of red, in the middle one of blue
    assert chroma_classes(r, g, b).tolist() == [[10, 11, 12, 13, 14]]


def test_of_one_colour_the_class_is_the_same_in_shadow_and_sun():
    for factor in (1.0, 2.0, 3.0):
        colour = [np.array([[level * factor]], np.uint8) for level in (40, 60, 80)]
        assert chroma_classes(*colour).tolist() == chroma_classes(*(one // 2 for one in colour)).tolist()


def test_black_has_the_class_of_grey():
    black, noise = np.zeros((1, 1), np.uint8), np.ones((1, 1), np.uint8)
    assert chroma_classes(black, black, noise) == chroma_classes(black, black, black) == 12


@pytest.mark.parametrize(
    ("highest", "share", "level"),
    [
        (255, 0.5, 250),
        (253, 0.5, 250),
        (252, 0.5, 249),
        (235, 0.01, 232),
        (235, 0.0021, 232),
        (235, 0.002, 250),
        (120, 0.0, 250),
    ],
)
def test_an_image_saturates_below_its_top_level_where_many_pixels_lie_there(highest, share, level):
    image = np.random.default_rng(0).integers(0, 100, 10000).astype(np.uint8)
    image[: round(share * image.size)] = highest
    image[0] = highest
    assert saturation_level(image.reshape(100, 100)) == level


def test_two_below_its_top_level_an_image_is_not_crowded():
    image = np.zeros((100, 100), np.uint8)
    image[:10] = 233
    image[0, 0] = 235
    assert saturation_level(image) == 250
    image[:10] = 234
    image[0, 0] = 235
    assert saturation_level(image) == 232


@pytest.mark.parametrize(("gain", "level"), [(1.25, 200), (2.0, 128), (0.9, 255)])
def test_a_camera_saturates_from_the_level_on_that_its_gain_says(gain, level):
    source = samples(low=10, high=250)
    assert saturates_from(source, rounded(source * gain), 250, 250) == pytest.approx(level, abs=8)


def test_light_that_saturates_most_of_a_level_cuts_off_no_more_than_the_gain_does():
    source = samples(low=10, high=200)
    target = rounded(source * 1.1)
    target[source > 100] = 255  # a lamp before the brighter half of what it sees
    assert saturates_from(source, target, 250, 250) == pytest.approx(0.85 * 250 / 1.1, abs=3)


def test_a_camera_that_never_saturates_is_cut_off_nowhere():
    source = samples()
    assert saturates_from(source, source // 2, 250, 250) == 255


def test_colours_that_saturate_predict_the_least_of_all_classes():
    source = np.concatenate([samples(seed=seed, high=250) for seed in range(2)])
    classes = np.repeat(np.array([3, 12], np.uint8), source.size // 2)
    target = rounded(source * np.where(classes == 3, 0.6, 0.9))
    found = predict(source, target, np.ones(source.size, dtype=np.bool_), classes).saturated_from(250)
    levels = np.array([200, 252], np.uint8)
    assert found.of(levels, np.array([3, 3], np.uint8)).tolist() == pytest.approx([120, 151], abs=3)
    assert found.of(levels, np.array([12, 12], np.uint8)).tolist() == pytest.approx([180, 151], abs=3)
