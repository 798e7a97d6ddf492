"""What one camera of a pair is brighter or darker by than the other predicts: `residual` is the reference's."""

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.light import CameraLevels, light_difference

HEIGHT, WIDTH, SHIFT = 188, 420, 20
INSIDE = np.s_[20:-20, SHIFT + 24 : -24]


def scene(seed=3, low=20, high=150):
    """What a reference and a source see of one plane, 20 half-resolution px apart."""
    patches = np.random.default_rng(seed).integers(low, high, (12, 30)).astype(np.uint8)
    wide = cv2.resize(patches, (WIDTH + SHIFT, HEIGHT), interpolation=cv2.INTER_LINEAR)
    return wide[:, :WIDTH].copy(), wide[:, SHIFT:].copy()


def coloured(grey, seed=5):
    """A colour picture with that luma, about: the patches have hues."""
    hues = np.random.default_rng(seed).uniform(0.6, 1.4, (12, 30, 3)).astype(np.float32)
    hues = cv2.resize(hues, (WIDTH + SHIFT, HEIGHT), interpolation=cv2.INTER_NEAREST)
    return np.clip(grey[..., None] * hues, 0, 255).astype(np.uint8)


@pytest.fixture
def greys():
    return scene()


@pytest.fixture
def colours():
    wide = coloured(np.pad(scene()[0], ((0, 0), (0, SHIFT)), mode="reflect"))
    return wide[:, :WIDTH].copy(), wide[:, SHIFT:].copy()


def facula(image, amplitude=200.0, radius=60, centre=(90, 220)):
    rho2 = (np.arange(HEIGHT)[:, None] - centre[0]) ** 2 + (np.arange(WIDTH) - centre[1]) ** 2
    light = amplitude * np.exp(-rho2 / (2 * (radius / 2) ** 2))
    light = light[..., None] * np.ones(3) if image.ndim == 3 else light
    return np.clip(image + light, 0, 255).astype(np.uint8)


def of_colour(colour):
    return CameraLevels(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), colour)


def compared(reference, source):
    """The difference of two pictures, grey or of three channels: views of a plane."""
    views = [of_colour(one) if one.ndim == 3 else CameraLevels(one) for one in (reference, source)]
    column = np.broadcast_to(np.arange(WIDTH, dtype=np.float32) - SHIFT, (HEIGHT, WIDTH)).copy()
    return light_difference(*views, column, column >= 0)


def strongest(reference, source):
    """The largest and the smallest residual of a window of a cell grid's size."""
    found = compared(reference, source)
    assert np.abs(found.residual).max() <= 1
    assert not found.residual[~found.comparable].any()
    means = cv2.blur(found.residual, (32, 24))[INSIDE]
    return float(means.max()), float(means.min())


def test_two_equal_cameras_differ_by_nothing(greys):
    assert strongest(*greys) == pytest.approx((0, 0), abs=0.01)


@pytest.mark.parametrize(
    "response",
    [
        lambda x: 0.5 * x,
        lambda x: 1.6 * x,
        lambda x: 0.7 * x + 50,
        lambda x: 255 * (x / 255) ** 0.5,
        lambda x: np.minimum(x, 80 + 0.4 * (x - 80)),
    ],
    ids=["half the gain", "more gain", "gain and offset", "gamma", "knee"],
)
def test_a_camera_of_another_response_differs_by_nothing(greys, response):
    reference, source = greys
    other = np.clip(np.rint(response(source.astype(float))), 0, 255).astype(np.uint8)
    assert strongest(reference, other) == pytest.approx((0, 0), abs=0.05)
    other = np.clip(np.rint(response(reference.astype(float))), 0, 255).astype(np.uint8)
    assert strongest(other, source) == pytest.approx((0, 0), abs=0.05)


def test_a_camera_of_another_white_balance_differs_by_nothing(colours):
    reference, source = colours
    warm = np.clip(source * np.array([0.6, 1.0, 1.4]), 0, 255).astype(np.uint8)
    assert strongest(reference, warm) == pytest.approx((0, 0), abs=0.06)
    assert strongest(np.clip(reference * np.array([0.6, 1.0, 1.4]), 0, 255).astype(np.uint8), source) == (
        pytest.approx((0, 0), abs=0.06)
    )


def test_a_facula_is_light_added_in_its_camera_and_removed_in_the_other():
    reference, source = scene(high=230)
    lit = np.s_[80:100, 210:230]
    assert compared(facula(reference), source).residual[lit].min() > 0.8
    assert compared(reference, facula(source, centre=(90, 220 - SHIFT))).residual[lit].max() < -0.4
    assert strongest(facula(reference), source) == pytest.approx((1, 0), abs=0.1)
    most, least = strongest(reference, facula(source))
    assert -least > most


def test_darkness_in_a_camera_is_removed_light(greys):
    reference, source = greys
    most, least = strongest(facula(reference, -200), source)
    assert least < -0.7
    assert most < 0.1


def test_a_facula_of_a_third_of_the_image_does_not_bend_the_curve(greys):
    reference, source = greys
    most, least = strongest(facula(reference, 2000, radius=70), source)
    assert most == pytest.approx(1)
    assert least > -0.1


@pytest.mark.parametrize("kind", ["greys", "colours"])
def test_no_light_is_more_than_one(kind, request):
    reference, source = request.getfixturevalue(kind)
    found = compared(facula(reference, 5000, radius=90), source)
    assert found.residual.max() == 1
    assert compared(reference, facula(source, 5000, radius=90)).residual.min() == -1


def test_what_is_saturated_in_the_source_has_no_upper_limit():
    reference, source = scene(high=120)
    reference[40:140, 100:300] = 250  # a sky that the source's sensor cuts off at 180
    source[40:140, 80:280] = 180
    cut = [np.minimum(source, 180), reference]
    assert strongest(cut[1], cut[0])[0] < 0.05
    lower = cut[0].copy()
    lower[40:140, 80:280] = 130  # it could have shown more, and did not
    lower[:10] = 180
    assert strongest(cut[1], np.where(lower > 130, lower, np.minimum(lower, 130)))[0] > 0.5


def test_a_colour_camera_that_is_exposed_longer_and_saturates_has_no_light():
    wide = np.pad(scene(high=180)[0], ((0, 0), (0, SHIFT)), mode="reflect").astype(np.float32)
    colour = np.repeat(wide[..., None], 3, axis=2)
    sky = np.linspace(150, 60, 80, dtype=np.float32)[:, None]  # blue, and darker to a grey camera than its luma
    colour[:80], wide[:80] = sky[..., None] * np.float32([1.3, 1.0, 0.85]), 0.6 * sky
    longer = np.clip(colour[:, :WIDTH] * 2.4, 0, 255).astype(np.uint8)
    grey = wide[:, SHIFT:].astype(np.uint8)
    assert strongest(longer, grey)[0] < 0.2
    longer[110:170, 200:300] = 255
    assert strongest(longer, grey)[0] > 0.3


def test_what_is_saturated_itself_is_not_darker():
    reference, source = scene(high=120)
    # The source alone tells that a lamp is brighter than the lit wall beside it.
    reference[40:140, 100:300] = 255
    source[40:140, 80:280] = 200
    source[60:120, 120:200] = 240
    assert strongest(reference, source)[1] > -0.05


def test_where_both_are_saturated_nothing_is_comparable(greys):
    reference, source = (facula(one, 3000, centre=(90, 220 - at)) for one, at in zip(greys, (0, SHIFT), strict=True))
    comparable = compared(reference, source).comparable
    assert not comparable[70:110, 200:240].any()
    assert comparable[:10, SHIFT:].all()
    assert compared(reference, greys[1]).comparable[70:110, 200:240].all()


def test_what_is_just_saturated_in_both_is_not_comparable_and_one_level_less_is():
    reference, source = scene(high=120)
    for first, level in ((0, 250), (50, 247), (100, 246)):  # three below a crowded top level images saturate
        reference[first : first + 40, 100:200], source[first : first + 40, 100 - SHIFT : 200 - SHIFT] = level, level
    comparable = compared(reference, source).comparable[:, 110:190]
    assert [comparable[first + 10 : first + 30].mean() for first in (0, 50, 100)] == [0, 0, 1]


def test_what_only_one_camera_sees_is_not_comparable(greys):
    assert not compared(*greys).comparable[:, :SHIFT].any()
    assert not compared(facula(greys[0], centre=(90, 0)), greys[1]).residual[:, :SHIFT].any()


@pytest.mark.parametrize("place", [0, 1], ids=["colour beside grey", "grey beside colour"])
def test_grey_and_colour_compare_alike_whichever_is_the_reference(colours, place):
    def pair(reference, source):
        return (
            (reference, cv2.cvtColor(source, cv2.COLOR_BGR2GRAY))
            if place == 0
            else (
                cv2.cvtColor(reference, cv2.COLOR_BGR2GRAY),
                source,
            )
        )

    reference, source = colours
    assert strongest(*pair(reference, source)) == pytest.approx((0, 0), abs=0.1)
    most, least = strongest(*pair(facula(reference), source))
    assert most > (0.6, 0.8)[place]  # strong hues tell less of what a grey camera should see
    assert least > -0.3
    most, least = strongest(*pair(reference, facula(source)))
    assert least < (-0.8, -0.6)[place]
    assert most < 0.3


def test_light_of_one_colour_shows_in_its_channel_and_the_mean_is_a_third(colours):
    reference, source = colours
    blue = reference.copy()
    blue[..., 0] = facula(np.ascontiguousarray(reference[..., 0]), 600)
    most, least = strongest(blue, source)
    assert most == pytest.approx(1 / 3, abs=0.05)
    assert least > -0.05


def test_a_pair_of_views_is_made_of_grey_pictures_and_colours_where_there_are_some(colours, greys):
    views = {1: CameraLevels(greys[0]), 2: CameraLevels(greys[1], colours[1])}
    assert views[1].channels == ()
    assert [one.shape for one in views[2].channels] == [(HEIGHT, WIDTH)] * 3
    assert views[2].classes.shape == (HEIGHT, WIDTH)
