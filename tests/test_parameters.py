"""Every number that decides a count or a verdict stands in a parameter file, and changes with a version."""

import ast
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.identification.parameters import (
    CAUSE_PRIORS,
    CHECK_PRIORS,
    JUDGING,
    PSMNET_PRIORS,
    STANDS_OUT,
    judging_settings,
)
from auditor.measurement.checks.found import MEASURING
from auditor.measurement.parameters import DISPARITY_ERROR, SGBM, TEXTURE
from auditor.measurement.warning_parameters import WARNING
from auditor.model.measurement import COUNTING_VERSIONS, EXPERIMENTS_VERSION
from auditor.model.parameters import Parameter, canonical_values, digest, list_parameters, parameter
from auditor.model.rig_kind import ComparedTo
from auditor.model.verdict import JUDGING_VERSION
from auditor.recordings.parameters import ACCOUNTING, FINDING_FILES, RIG_FINDING, SYNCHRONISING
from tests import digests

WRITTEN_BY = "python -m tests.digests keeps the new digest"

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "auditor"

SCANNED = tuple(
    path for room in ("model", "measurement", "identification") for path in sorted((PACKAGE / room).rglob("*.py"))
)
PARAMETER_FILES = (
    "model/parameters.py",
    "measurement/parameters.py",
    "measurement/point_parameters.py",
    "measurement/time_parameters.py",
    "measurement/warning_parameters.py",
    "identification/parameters.py",
    "identification/evidence_parameters.py",
    "identification/refresh_parameters.py",
)
ELSEWHERE = {
    "measurement/disparity/matchers/psmnet/": "the architecture of PSMNet, and how it is run",
    "measurement/thumbnails.py": "thumbnails for the report",
    "measurement/localisation/": "where damage is shown, once it was found",
    "measurement/drawing/": "pictures of frames that were measured before",
}
"""Folders and files whose numbers change neither a count nor a verdict."""

STRUCTURAL: Mapping[str, tuple[tuple[float, ...], str]] = {
    "measurement/fault_features/lidar_agreement.py": (
        (200, 24),
        "points of which a share says something; no fit at all",
    ),
    "identification/prior.py": ((1e-5,), "a rate that no clean frames reach"),
    "identification/refreshing/drives.py": ((5,), "groups that judge each other"),
    "identification/likelihood.py": ((6,), "sensors that sets of several are made of"),
    "identification/faults.py": (
        (0.2, 0.01),
        "the score from which on causes are listed; a logarithm that is finite",
    ),
    "measurement/fault_features/calibration_check.py": ((5, 200, 20), "frames that are looked at for a warning"),
    "measurement/ego_motion.py": ((0.99, 100, 3), "OpenCV's confidence and trials of RANSAC, and levels of a pyramid"),
    "measurement/disparity/lidar.py": ((7,), "points of which one is asked"),
    "model/calibration.py": ((100_000,), "frames that are kept in memory"),
    "model/coverage.py": ((6, 10, 1000), "sensors named in a line; tenths of a percent"),
    "model/stamps.py": ((10, 9), "nanoseconds in a second"),
    "identification/paper.py": (
        (
            4,
            3,
        ),
        "N - 3 is positive; N - 3",
    ),
    "measurement/own_past.py": (
        (3, 14),
        "no rotation, in three dimensions; pictures that are held",
    ),
    "measurement/moving_things.py": ((3,), "cells that touch"),
    "measurement/checks/in_time/parallax_conflict.py": (
        (256, 2048),
        "points and patches compared at once, to bound memory",
    ),
    "measurement/checks/scattered_returns.py": ((3,), "the points that any plane goes through"),
    "measurement/checks/free_space_conflict.py": (
        (3, 5, 1e6, 0.5),
        "cells that touch, and gaps of a few beams; what has no range; the middle of a cell",
    ),
    "identification/causes.py": ((0.5,), "the score from which on a fault is as likely as an attack"),
    "identification/incidents/sequential.py": ((3600, 0.01), "seconds in an hour; a rate that no clean drives reach"),
    "identification/incidents/events.py": ((512, 3600, 0.5), "windows at once; seconds in an hour; the most frames"),
    "identification/cross_validation.py": (
        (
            1.959963984540054,
            4,
            3600,
            200,
        ),
        "the 95 % quantile and Wilson's formula; an hour; thresholds that are made of others, which judge no scan",
    ),
    "identification/drift.py": (
        (0.6744897501960817, 4, 5, 3, 0.01, 0.05, 0.16, 0.5, 0.84, 0.95, 0.99),
        "the median of |x| of a normal distribution; the bias of a correlation of few values; parts and quantiles",
    ),
    "identification/refreshing/gate.py": ((1.959963984540054, 100), "the 95 % quantile; percent"),
    "identification/refreshing/two_samples.py": (
        (1.4826, 3, 8),
        "standard deviations in a median absolute deviation; Wallace's approximation",
    ),
    "identification/statistics.py": (
        (65_536, 0.2),
        "how much is held in memory; stretches that overlap",
    ),
    "identification/transfer.py": ((8,), "calibrations of parts that are kept in memory"),
    "identification/thresholds.py": ((20,), "digits of exact arithmetic"),
    "measurement/count_grid.py": ((127, 8), "the largest signed byte; sizes of images kept in memory"),
    "measurement/checks/false_ranges.py": ((12, 0.5), "the variance of what is spread evenly; the median"),
    "measurement/checks/photometric_consistency.py": ((4,), "pictures that are warped at once"),
    "measurement/checks/coloured_light.py": ((255,), "white"),
    "measurement/checks/light.py": ((255, 256), "white; levels of a byte"),
    "measurement/checks/in_time/still_light.py": (
        (255, 3, 4, 8, 12),
        "white; pixels that touch; sums of two sides; sizes of pictures kept in memory; a pixel's own variance",
    ),
    "measurement/checks/striped_light.py": ((256,), "levels of a byte"),
    "measurement/tone_curve.py": ((255, 256), "white; levels of a byte"),
    "measurement/checks/point_distribution.py": (
        (3, 12),
        "a cell and its neighbours, in three dimensions; the variance of rounding is a twelfth of the step squared",
    ),
    "measurement/disparity/matchers/model_description.py": (
        (
            3,
            255.0,
        ),
        "channels; white",
    ),
    "measurement/disparity/matchers/own_networks.py": ((4,), "axes"),
    "measurement/disparity/matchers/onnx_models.py": ((3,), "a log level"),
    "measurement/disparity/matchers/sgbm.py": (
        (16, 255, 256, 20),
        "OpenCV's unit of a disparity; white; levels of a byte; a check that is left out",
    ),
    "measurement/disparity/rectification.py": (
        (
            0.5,
            8,
        ),
        "the centre of a pixel; rigs remembered",
    ),
    "measurement/disparity/stereo.py": (
        (
            3,
            8,
        ),
        "the smallest Sobel kernel and the sum of its weights",
    ),
    "measurement/disparity/half_resolution.py": ((8,), "sizes of images kept in memory"),
    "measurement/disparity/warping.py": ((0.5,), "the centre of a pixel"),
    "measurement/fault_features/collect.py": ((255,), "white"),
    "measurement/fault_features/fewer_returns.py": ((360, 90, 100), "degrees of a turn and up to the zenith; per cent"),
    "measurement/fault_features/row_alignment.py": (
        (3, 10, 0.05, 15),
        "an axis; where the search for a corner ends; points of which a share says something",
    ),
    "measurement/frame.py": ((0.05, 254), "seconds between two looks at a queue; the two top levels of a byte"),
    "model/checks/__init__.py": ((64, 512), "rigs, and sets of absent sensors, whose checks are kept in memory"),
    "model/optics/common_view.py": (
        (3, 4, 32, 4096, 8, 0.1, 0.05, 0.25),
        "dimensions; rays, cells and px that bound the work; a mean of rays and a division that are guarded",
    ),
    "model/optics/geometry.py": (
        (
            3,
            4,
        ),
        "dimensions",
    ),
    "model/optics/sensors.py": (
        (
            4000,
            4,
            5,
            8,
            12,
            60,
            1e-09,
            16,
        ),
        "coefficients of the models; the inversion's rounds, accuracy and reach; bits of a pixel",
    ),
    "model/measurement.py": (
        (*set(COUNTING_VERSIONS.values()), EXPERIMENTS_VERSION, 7, 4),
        "versions; how sums and regions are stored",
    ),
    "model/pictures.py": ((5,), "seconds between what is kept of usual frames, which decides nothing"),
    "model/settings.py": (
        (0.99, 0.5, 4096, 16),
        "defaults and ranges of settings, which users choose and docs/settings.md lists",
    ),
    "model/verdict.py": ((JUDGING_VERSION,), "a version"),
    "model/rig.py": ((3, 4), "dimensions, and N - 3"),
}
"""By module the numbers that are definitions, not choices."""


def place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def numbers(path: Path) -> Iterator[tuple[int, float]]:
    """Line and value of each number in a module, but for 0, 1 and 2, and those in an index or a parameter itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.Subscript) for part in ast.walk(node.slice)}
    declared = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name))
    inside |= {id(p) for call in declared if call.func.id in ("parameter", "PriorOf") for p in ast.walk(call)}
    small = {id(node) for node in ast.walk(tree) if isinstance(node, ast.Constant) and node.value in (0, 1, 2)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float) and id(node) not in inside | small:
            yield node.lineno, node.value


def every_parameter() -> tuple[Parameter, ...]:
    return list_parameters(*RIG_FINDING, *SYNCHRONISING, *MEASURING, *WARNING, *JUDGING, PSMNET_PRIORS)


def test_numbers_that_can_change_a_count_or_a_verdict_stand_in_the_parameter_files_alone() -> None:
    found = [
        f"{place(path)}:{line}: {value}"
        for path in SCANNED
        if place(path) not in PARAMETER_FILES and not place(path).startswith(tuple(ELSEWHERE))
        for line, value in numbers(path)
        if value not in STRUCTURAL.get(place(path), ((), ""))[0]
    ]
    assert not found, "a parameter with unit and source, or a line of STRUCTURAL with its reason:\n" + "\n".join(found)


def test_no_number_is_called_structural_that_is_not_there() -> None:
    there = {place(path): {value for _, value in numbers(path)} for path in SCANNED}
    unused = [(name, value) for name, (values, _) in STRUCTURAL.items() for value in values if value not in there[name]]
    assert not unused


@pytest.mark.parametrize("compared_to", ComparedTo)
def test_measuring_and_synchronising_parameters_change_with_their_counting_version(compared_to: ComparedTo) -> None:
    kept = digests.read()[compared_to].get(str(COUNTING_VERSIONS[compared_to]))
    assert kept == digests.counting(compared_to), f"raise it: the same frame may give other counts; {WRITTEN_BY}"


def test_judging_parameters_change_with_the_judging_version() -> None:
    kept = digests.read()["judging"].get(str(JUDGING_VERSION))
    of_psmnet = digests.read()["judging_psmnet"].get(str(JUDGING_VERSION))
    found = digests.judging(), digests.judging_psmnet()
    assert (kept, of_psmnet) == found, f"raise JUDGING_VERSION: there may be other verdicts; {WRITTEN_BY}"


def test_a_changed_value_changes_the_digest_and_its_unit_and_source_do_not() -> None:
    @dataclass(frozen=True)
    class DisparityError:
        absolute_px: float = parameter(3.0, unit="pixels", source="somebody")
        relative: float = parameter(0.05, unit="share", source="somebody")

    assert digest(DisparityError()) == digest(DISPARITY_ERROR)
    assert digest(DisparityError(absolute_px=2.9)) != digest(DISPARITY_ERROR)
    assert digest(DISPARITY_ERROR, SGBM) == digest(SGBM, DISPARITY_ERROR)


def test_the_settings_are_canonical_json_of_all_values() -> None:
    settings = canonical_values(*MEASURING)
    values = json.loads(settings)
    assert values["disparity_error.absolute_px"] == 3.0
    assert values["row_alignment.blocks"] == [6, 20]
    assert len(values) == len(list_parameters(*MEASURING))
    assert settings == json.dumps(values, sort_keys=True, separators=(",", ":"))
    assert json.loads(judging_settings())["hierarchy.farthest"] == 1.5


def test_a_parameter_without_a_unit_or_a_source_cannot_be_made() -> None:
    with pytest.raises(TypeError):
        parameter(1.0, unit="px")  # type: ignore[call-arg]
    for lacking in ({"unit": "", "source": "somebody"}, {"unit": "px", "source": ""}):
        with pytest.raises(ValueError, match="no unit or no source"):
            parameter(1.0, **lacking)


def test_a_group_with_a_plain_field_is_refused() -> None:
    @dataclass(frozen=True)
    class Plain:
        value: float = field(default=1.0)

    with pytest.raises(KeyError):
        list_parameters(Plain())


def test_a_parameter_is_listed_with_its_group_value_unit_and_source() -> None:
    [found] = list_parameters(replace(TEXTURE, fewest_levels=1.5))[:1]
    assert (found.group, found.name, found.value) == ("texture", "fewest_levels", 1.5)
    assert found.unit.startswith("grey levels")
    assert "1.5, 2.0 and 2.5 tried" in found.source


def test_no_two_groups_have_one_name_and_no_list_has_a_group_twice() -> None:
    for groups in (
        (*FINDING_FILES, *RIG_FINDING, *SYNCHRONISING, *ACCOUNTING),
        (*MEASURING, *WARNING),
        JUDGING,
    ):
        assert not [name for name, times in Counter(type(group).__name__ for group in groups).items() if times > 1]
    groups_named: dict[str, set[int]] = {}
    for group in (*FINDING_FILES, *RIG_FINDING, *SYNCHRONISING, *MEASURING, *WARNING, *JUDGING):
        groups_named.setdefault(type(group).__name__, set()).add(id(group))
    assert not [name for name, groups in groups_named.items() if len(groups) > 1]


def test_every_group_of_a_parameter_file_is_listed() -> None:
    for name, listed in (
        ("recordings", (*FINDING_FILES, *RIG_FINDING, *SYNCHRONISING, *ACCOUNTING)),
        ("measurement", (*MEASURING, *WARNING)),
        ("identification", (*JUDGING, STANDS_OUT, PSMNET_PRIORS)),
    ):
        classes = re.findall(r"^class (\w+):", (PACKAGE / name / "parameters.py").read_text(), re.MULTILINE)
        assert set(classes) <= {type(group).__name__ for group in listed}
    shared = re.findall(r"^class (\w+):", (PACKAGE / "model" / "parameters.py").read_text(), re.MULTILINE)
    assert set(shared) <= {Parameter.__name__, *(type(group).__name__ for group in (*MEASURING, *JUDGING))}


def test_documents_that_sources_name_are_there() -> None:
    named = {path for one in every_parameter() for path in re.findall(r"docs/\w+\.md", one.source)}
    assert named
    assert not [path for path in named if not (ROOT / path).is_file()]


def test_every_prior_has_a_mean_deviations_above_zero_and_a_tail_of_one_at_least() -> None:
    # Of frames without any conflict half have the least log odds there are: they spread far below, and end soon above.
    bounded = {"parallax_conflict"}
    for one in list_parameters(CHECK_PRIORS, CAUSE_PRIORS, PSMNET_PRIORS):
        assert isinstance(one.value, tuple)
        mean, within, between, *tail = one.value
        assert -10 < mean < 10
        assert min(within, between) > 0
        assert min(tail, default=1) >= (0.5 if one.name in bounded else 1)


def test_decimals_are_written_exactly() -> None:
    @dataclass(frozen=True)
    class Rate:
        r: Decimal = parameter(Decimal("0.010"), unit="rate", source="somebody")

    assert canonical_values(Rate()) == '{"rate.r":"0.010"}'
