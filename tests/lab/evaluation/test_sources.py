"""Streets as sources of clean frames."""

from auditor.lab.evaluation import Street
from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.streets import STYLES
from auditor.model.frames import Frame

SCALE = 0.2


def shapes(street: Street) -> set[tuple[int, ...]]:
    with street.open() as [drive]:
        frame = next(drive.frames)
    assert isinstance(frame, Frame)
    return {image.pixels.shape for image in frame.images.values()}


def test_a_few_streets_hold_every_style_under_every_condition() -> None:
    families = {Street(seed, 1).family for seed in range(1000, 1018)}
    assert families == {f"{style}, {condition}" for style in STYLES for condition in CONDITIONS}


def test_a_street_says_its_family_and_gives_it_in_its_name() -> None:
    street = Street(1003, 1, scale=SCALE)
    with street.open() as [drive]:
        assert (drive.family, drive.name) == (street.family, f"{street.family} 1003")


def test_streets_have_grey_cameras_and_colour_cameras_and_both() -> None:
    grey, colour = (75, 248), (75, 248, 3)
    found = [shapes(Street(seed, 1, scale=SCALE)) for seed in (1008, 1009, 1015)]
    assert found == [{grey}, {colour}, {grey, colour}]


def test_a_street_of_smaller_pictures_is_another_recording() -> None:
    with Street(1003, 1).open() as [full], Street(1003, 1, scale=0.5).open() as [half]:
        assert full.recording_id != half.recording_id
        assert (full.rig.camera(1).width_px, half.rig.camera(1).width_px) == (1242, 621)
        assert half.rig.camera(1).focal_px < 0.51 * full.rig.camera(1).focal_px
