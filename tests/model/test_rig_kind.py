"""How alike two vehicles are: of one kind, of similar kinds, or neither."""

from dataclasses import replace

import pytest

from auditor.model.rig_kind import Likeness, RigKind

OF_0009 = RigKind(True, ((1242, 375),) * 4, (721.5377,) * 4, (0.0643, 0.4729, 0.0598))
OF_04 = RigKind(True, ((1226, 370),) * 4, (707.0912,) * 4, (0.0627, 0.4744, 0.0610))


def test_a_second_production_year_is_similar_both_ways() -> None:
    assert OF_0009.likeness(OF_04) is OF_04.likeness(OF_0009) is Likeness.SIMILAR
    assert not OF_0009.matches(OF_04)


@pytest.mark.parametrize(
    ("changed", "likeness"),
    [
        ({}, Likeness.SAME),
        ({"focals_px": (708.0,) * 4}, Likeness.SAME),
        ({"focals_px": (706.0,) * 4}, Likeness.SIMILAR),
        ({"focals_px": (721.5, 721.5, 721.5, 690.0)}, Likeness.SIMILAR),
        ({"focals_px": (721.5, 721.5, 721.5, 680.0)}, Likeness.OTHER),
        ({"sizes_px": ((1242, 375),) * 3 + ((1242, 374),)}, Likeness.SIMILAR),
        ({"sizes_px": ((1242, 350),) * 4}, Likeness.OTHER),
        ({"sizes_px": ((1180, 375),) * 4}, Likeness.SIMILAR),
        ({"sizes_px": ((1179, 375),) * 4}, Likeness.OTHER),
        ({"baselines_m": (0.0690, 0.4729, 0.0598)}, Likeness.SAME),
        ({"baselines_m": (0.0820, 0.4729, 0.0598)}, Likeness.SIMILAR),
        ({"baselines_m": (0.0850, 0.4729, 0.0598)}, Likeness.OTHER),
        ({"baselines_m": (0.0643, 0.4960, 0.0598)}, Likeness.SIMILAR),
        ({"baselines_m": (0.0643, 0.4990, 0.0598)}, Likeness.OTHER),
        ({"lidar": False}, Likeness.OTHER),
        ({"baselines_m": (0.0643, 0.4729, 0.0598, 0.5, 0.5, 0.6)}, Likeness.OTHER),
    ],
)
def test_kinds_are_alike_as_far_as_lengths_and_sizes_agree(changed: dict, likeness: Likeness) -> None:
    assert OF_0009.likeness(replace(OF_0009, **changed)) is likeness


def test_kinds_with_other_numbers_of_cameras_are_not_alike() -> None:
    fewer = RigKind(True, OF_0009.sizes_px[:3], OF_0009.focals_px[:3], OF_0009.baselines_m[:2])
    assert OF_0009.likeness(fewer) is Likeness.OTHER
    assert replace(OF_0009, baselines_m=()).likeness(replace(fewer, baselines_m=())) is Likeness.OTHER
