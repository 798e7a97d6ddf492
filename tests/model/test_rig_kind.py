"""How alike two vehicles are: of one kind, of similar kinds, or neither."""

from dataclasses import replace

import pytest

from auditor.model.rig_kind import RigKind, Similarity

OF_0009 = RigKind(True, ((1242, 375),) * 4, (721.5377,) * 4, (0.0643, 0.4729, 0.0598))
OF_04 = RigKind(True, ((1226, 370),) * 4, (707.0912,) * 4, (0.0627, 0.4744, 0.0610))


def test_a_second_production_year_is_similar_both_ways() -> None:
    assert OF_0009.similarity(OF_04) is OF_04.similarity(OF_0009) is Similarity.SIMILAR
    assert not OF_0009.matches(OF_04)


@pytest.mark.parametrize(
    ("changed", "similarity"),
    [
        ({}, Similarity.SAME),
        ({"focals_px": (708.0,) * 4}, Similarity.SAME),
        ({"focals_px": (706.0,) * 4}, Similarity.SIMILAR),
        ({"focals_px": (721.5, 721.5, 721.5, 690.0)}, Similarity.SIMILAR),
        ({"focals_px": (721.5, 721.5, 721.5, 680.0)}, Similarity.OTHER),
        ({"sizes_px": ((1242, 375),) * 3 + ((1242, 374),)}, Similarity.SIMILAR),
        ({"sizes_px": ((1242, 350),) * 4}, Similarity.OTHER),
        ({"sizes_px": ((1180, 375),) * 4}, Similarity.SIMILAR),
        ({"sizes_px": ((1179, 375),) * 4}, Similarity.OTHER),
        ({"baselines_m": (0.0690, 0.4729, 0.0598)}, Similarity.SAME),
        ({"baselines_m": (0.0820, 0.4729, 0.0598)}, Similarity.SIMILAR),
        ({"baselines_m": (0.0850, 0.4729, 0.0598)}, Similarity.OTHER),
        ({"baselines_m": (0.0643, 0.4960, 0.0598)}, Similarity.SIMILAR),
        ({"baselines_m": (0.0643, 0.4990, 0.0598)}, Similarity.OTHER),
        ({"lidar": False}, Similarity.OTHER),
        ({"baselines_m": (0.0643, 0.4729, 0.0598, 0.5, 0.5, 0.6)}, Similarity.OTHER),
    ],
)
def test_kinds_are_alike_as_far_as_lengths_and_sizes_agree(changed: dict, similarity: Similarity) -> None:
    assert OF_0009.similarity(replace(OF_0009, **changed)) is similarity


def test_kinds_with_other_numbers_of_cameras_are_not_alike() -> None:
    fewer = RigKind(True, OF_0009.sizes_px[:3], OF_0009.focals_px[:3], OF_0009.baselines_m[:2])
    assert OF_0009.similarity(fewer) is Similarity.OTHER
    assert replace(OF_0009, baselines_m=()).similarity(replace(fewer, baselines_m=())) is Similarity.OTHER
