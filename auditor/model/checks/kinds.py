"""The checks. Each is declared here, once: all that knows checks by their names follows from this table.

A check is measured in the module `where` of `measurement/checks`, by `measure_x` of `Check.X` or, where several are
counted together, by a function of another name. Its prior, its vote and what all texts say of it are taken from here.
"""

from auditor.model.checks import prior_sources as sources
from auditor.model.checks.kind import CellUnit, CheckKind, DeclaredCheck, Of, PriorOf, Vote, Words


class Check(DeclaredCheck):
    """A kind of statistic of a sensor. A new one stands last: measurements keep this order, old ones lack the last."""

    LIDAR_CONFLICT = (
        "lidar_conflict",
        CheckKind(
            Of.PAIRS,
            Words(
                "LiDAR conflict",
                "two cameras agree with each other and not with it",
                "the cameras agree with each other and not with it",
                "the cameras disagree with the LiDAR",
                evidence_by_two="S_{i} and S_{k} both disagree with the LiDAR",
            ),
            (PriorOf("conflict", (-1.4, 0.45, 0.29, 1.0), sources.FITTED),),
            CellUnit.POINTS,
            Vote.MEAN,
            common=True,
        ),
    )
    ADDED_LIGHT = (
        "added_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "added light",
                "brighter than the others' images predict",
                "sees light that the others do not",
                "S_{i} sees light that others do not",
                "one of the two sees light that the other does not",
                "S_{i} or S_{k} alone sees light",
            ),
            (
                sources.LIGHT_OF_ONE,
                PriorOf("light_of_two", (-2.2, 0.33, 0.33, 1.3), sources.REAL),
                PriorOf("light", (-2.92, 0.3, 0.29, 1.9), sources.LIGHT),
            ),
            CellUnit.LIGHT,
            Vote.LIGHT,
            where="light",
            of_light=True,
            common=True,
        ),
    )
    REMOVED_LIGHT = (
        "removed_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "removed light",
                "darker than the others' images predict",
                "lacks light that the others see",
                "S_{i} lacks light that others see",
                "one of the two lacks light that the other sees",
                "S_{i} or S_{k} alone lacks light",
            ),
            (
                sources.LIGHT_OF_ONE,
                PriorOf("darkness_of_two", (-2.75, 0.33, 0.35, 2.0), sources.FITTED),
                PriorOf("darkness", (-3.15, 0.26, 0.24, 2.0), sources.LIGHT),
            ),
            CellUnit.LIGHT,
            Vote.SMALLEST,
            where="light",
            of_light=True,
            opposite_of="added_light",
            common=True,
            never_of_two=True,
        ),
    )
    PHOTOMETRIC_INCONSISTENCY = (
        "photometric_inconsistency",
        CheckKind(
            Of.CAMERAS,
            Words(
                "photometric inconsistency",
                "it does not see what the others see",
                "does not see what the others see",
                "S_{i} does not see what others see",
                "the two do not see the same",
                "S_{i} and S_{k} do not see the same",
            ),
            (
                PriorOf("inconsistency_of_one", (-2.5, 0.59, 0.4, 1.45), sources.FITTED),
                PriorOf("inconsistency_of_two", (-3.3, 0.46, 0.31, 1.7), sources.TAILS),
                PriorOf("inconsistency", (-3.3, 0.52, 0.3, 1.95), sources.TAILS),
            ),
            CellUnit.PIXELS,
            Vote.SMALLEST,
            where="photometric_consistency",
            common=True,
        ),
    )
    POINT_DROPOUT = (
        "point_dropout",
        CheckKind(
            Of.VIEW,
            Words(
                "point dropout",
                "a strip of its view lacks points",
                "lacks points in a part of its view",
                "the LiDAR lacks points",
                evidence_by_two="the LiDAR lacks points in the view of S_{k}",
            ),
            (PriorOf("point_dropout", (-0.35, 0.38, 0.22, 1.35), sources.FITTED),),
            where="point_distribution",
            common=True,
        ),
    )
    ISOLATED_POINTS = (
        "isolated_points",
        CheckKind(
            Of.VIEW,
            Words(
                "isolated points",
                "points have next to no neighbours",
                "has points that stand alone",
                "the LiDAR has isolated points",
                evidence_by_two="the LiDAR has isolated points in the view of S_{k}",
            ),
            (PriorOf("isolated_points", (-2.0, 0.46, 0.33, 1.0), sources.FITTED),),
            where="point_distribution",
            common=True,
        ),
    )
    COLOURED_LIGHT = (
        "coloured_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "coloured light",
                "light of one colour that the others lack",
                "sees light of one colour that the others do not",
                "S_{i} sees light of one colour that others do not",
            ),
            (PriorOf("coloured_light", (-3.1, 0.36, 0.25, 1.9), sources.TAILS),),
            CellUnit.LIGHT,
            Vote.MEAN,
            of_colours=True,
            of_light=True,
        ),
    )
    LOST_RETURNS = (
        "lost_returns",
        CheckKind(
            Of.SEVERAL_PAIRS,
            Words(
                "lost returns",
                "cameras see a surface where it scans and has a hole",
                "has no return from what the cameras see",
            ),
            (PriorOf("lost_returns", (-3.78, 0.56, 0.1, 1.4), sources.LOST),),
            CellUnit.SURFACES,
            Vote.SMALLEST,
        ),
    )
    STRIPED_LIGHT = (
        "striped_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "striped light",
                "rows are lit that are not in the others",
                "has light in some rows that the others do not",
                "S_{i} has light in some rows that others do not",
                "one of the two has light in some rows that the other does not",
                "S_{i} or S_{k} alone has light in some rows",
            ),
            (sources.SELDOM,),
            vote=Vote.SMALLEST,
            of_light=True,
        ),
    )
    FALSE_RANGES = (
        "false_ranges",
        CheckKind(
            Of.SEVERAL_PAIRS,
            Words(
                "false ranges",
                "cameras contradict a cluster, or see a sector shifted",
                "has points where the cameras see nothing",
            ),
            (PriorOf("false_ranges", (-3.88, 0.45, 0.15, 1.7), sources.RANGES),),
            vote=Vote.RANGES,
        ),
    )
    ROUGH_RANGES = (
        "rough_ranges",
        CheckKind(
            Of.VIEW,
            Words(
                "rough ranges",
                "neighbouring ranges of a sector jitter",
                "has noisy ranges in a part of its view",
                "the LiDAR's ranges are noisy in a part",
                evidence_by_two="the LiDAR's ranges are noisy in a part of the view of S_{k}",
            ),
            (PriorOf("rough_ranges", (-3.8, 0.7, 0.3, 1.45), sources.RANGES),),
            where="point_distribution",
        ),
    )
    PARALLAX_CONFLICT = (
        "parallax_conflict",
        CheckKind(
            Of.LONE_CAMERA,
            Words(
                "parallax conflict",
                "a camera's pictures of two moments agree, and not with it",
                "the camera and its own past agree with each other and not with it",
                "the camera and its own past disagree with the LiDAR",
            ),
            (PriorOf("parallax_conflict", (-3.4, 0.7, 0.2, 1.7), sources.IN_TIME),),
            CellUnit.POINTS,
            Vote.MEAN,
            where="in_time.parallax_conflict",
        ),
    )
    STILL_LIGHT = (
        "still_light",
        CheckKind(
            Of.LIDAR,
            Words(
                "still light",
                "light stays in its picture while the scene moves, by LiDAR ranges",
                "has light that stays in its picture while the scene moves",
                "S_{i} has light that stays in its picture while the scene moves",
            ),
            (PriorOf("still_light", (-3.6, 0.65, 0.3, 1.0), sources.IN_TIME),),
            of_light=True,
            where="in_time.still_light",
        ),
    )
    FREE_SPACE_CONFLICT = (
        "free_space_conflict",
        CheckKind(
            Of.OWN_SCANS,
            Words(
                "free-space conflict",
                "points stand where its beams passed a moment ago",
                "has points where its beams passed a moment ago",
            ),
            (sources.SELDOM,),
        ),
    )
    SCATTERED_RANGES = (
        "scattered_ranges",
        CheckKind(
            Of.SEVERAL_PAIRS,
            Words(
                "scattered ranges",
                "cameras contradict a cluster whose points scatter, as in dust",
                "has points that scatter where the cameras see nothing, as in dust",
            ),
            (PriorOf("scattered_ranges", (-3.88, 0.45, 0.15, 1.2), sources.SCATTERED),),
            vote=Vote.MEAN,
            where="false_ranges",
            of_aerosol=True,
        ),
    )
    SCATTERED_RETURNS = (
        "scattered_returns",
        CheckKind(
            Of.OWN_SCANS,
            Words(
                "scattered returns",
                "points scatter where its beams passed a moment ago, as in dust",
                "has points that scatter where its beams passed a moment ago, as in dust",
            ),
            (sources.SELDOM,),
            of_aerosol=True,
        ),
    )
    CONTESTED_RETURNS = (
        "contested_returns",
        CheckKind(
            Of.OTHER_SCANS,
            Words(
                "contested returns",
                "points stand where another LiDAR's beams passed",
                "has points where the beams of other LiDARs passed",
                "S_{i} has points where the beams of other LiDARs passed",
                "one of the two has points where the other's beams passed",
                "S_{i} has points where the beams of S_{k} passed: two LiDARs do not tell which of them is wrong",
            ),
            (sources.SELDOM,),
            vote=Vote.SMALLEST,
        ),
    )
    VEILING_LIGHT = (
        "veiling_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "veiling light",
                "the darkest parts are lit that are dark in the others",
                "has light in its darkest parts that the others do not",
                "S_{i} has light in its darkest parts that others do not",
                "one of the two has light in its darkest parts that the other does not",
                "S_{i} or S_{k} alone has light in its darkest parts",
            ),
            (sources.SELDOM,),
            vote=Vote.SMALLEST,
            of_light=True,
        ),
    )
    UNMATCHED_LIGHT = (
        "unmatched_light",
        CheckKind(
            Of.CAMERAS,
            Words(
                "unmatched light",
                "a saturated patch is brighter than all that the others show",
                "has a patch that is brighter than all that the others show there",
                "S_{i} has a patch that is brighter than all that others show there",
                "one of the two has a patch that is brighter than all that the other shows there",
                "S_{i} or S_{k} has a patch that is brighter than all that the other shows there",
            ),
            (PriorOf("unmatched_light_of_one", (-3.9, 0.45, 0.25, 1.8), sources.UNMATCHED), sources.SELDOM),
            vote=Vote.SMALLEST,
            of_light=True,
            never_of_two=True,
            by_all_but_one=True,
        ),
    )
    SURROUNDING_CONFLICT = (
        "surrounding_conflict",
        CheckKind(
            Of.SURROUNDINGS,
            Words(
                "surrounding conflict",
                "points stand where its beams passed just before, on all sides",
                "has points where its beams passed a moment ago",
            ),
            (sources.SELDOM,),
            where="free_space_conflict",
        ),
    )
    FOREIGN_TEXTURE = (
        "foreign_texture",
        CheckKind(
            Of.CAMERAS,
            Words(
                "foreign texture",
                "it shows something else where two others agree what is there",
                "shows something else where others agree what is there",
                "S_{i} shows something else where others agree what is there",
            ),
            (PriorOf("foreign_texture", (-3.9, 0.5, 0.2, 1.75), sources.FOREIGN),),
            vote=Vote.SMALLEST,
            never_of_two=True,
            by_two_others=True,
        ),
    )
    STILL_TEXTURE = (
        "still_texture",
        CheckKind(
            Of.LIDAR,
            Words(
                "still texture",
                "something stays in its picture while the scene moves",
                "shows something that stays in its picture while the scene moves",
                "S_{i} shows something that stays in its picture while the scene moves",
            ),
            (PriorOf("still_texture", (-3.6, 0.8, 0.3, 1.45), sources.IN_TIME),),
            of_light=True,
            where="in_time.still_texture",
        ),
    )
    ADDED_TEXTURE = (
        "added_texture",
        CheckKind(
            Of.CAMERAS,
            Words(
                "added texture",
                "it has texture where the others are smooth",
                "has texture where the others see smooth surfaces",
                "S_{i} has texture where others see smooth surfaces",
                "one of the two has texture where the other sees smooth surfaces",
                "S_{i} or S_{k} alone has texture where the other sees smooth surfaces",
            ),
            (
                PriorOf("added_texture_of_one", (-3.55, 0.43, 0.22, 2.0), sources.TEXTURE),
                PriorOf("added_texture_of_two", (-3.77, 0.36, 0.1, 1.95), sources.TEXTURE),
                PriorOf("added_texture", (-3.9, 0.3, 0.1, 1.9), sources.TEXTURE),
            ),
            vote=Vote.SMALLEST,
            of_light=True,
            never_of_two=True,
        ),
    )
