"""Thresholds theta at a designated false-alarm rate r (Eq. 3 and 9), and what they may be used for."""

import json
from collections.abc import Iterator, Sequence
from decimal import ROUND_FLOOR, Decimal, InvalidOperation, localcontext

from auditor.errors import SettingError, ThresholdsError
from auditor.model.calibration import Calibration, Thresholds
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig_kind import RigKind, Similarity

BELOW_EVERY_ERROR = -1.0
"""theta at r = 1, where every sample has to lie above it; disparity errors are never negative."""

DIGITS_OF_A_COUNT = 20


def parse_r(text: str) -> Decimal:
    """The designated false-alarm rate r, written as '0.01' or as '1%'. Raises SettingError."""
    number = text.strip()
    try:
        r = Decimal(number.removesuffix("%").strip())
    except InvalidOperation:
        raise SettingError(f"{text!r} is not a number", where="r", remedy="write it as 0.01 or 1%") from None
    if number.endswith("%"):
        with localcontext(prec=len(r.as_tuple().digits) + DIGITS_OF_A_COUNT):
            r = r.scaleb(-2) if r.is_finite() else r
    checked(r)
    return r


def threshold(samples: Sequence[float], r: Decimal) -> float:
    """Theta_r: the sample of rank N - floor(r N), the first being rank 1; -1 at r = 1 (Eq. 3).

    `samples` are N clean disparity errors in ascending order. Without ties exactly floor(r N) of them lie above theta,
    with ties at most. Raises ThresholdsError where N = 0 and SettingError where r is not in [0, 1].
    """
    rank = threshold_rank(len(samples), r)
    return float(samples[rank - 1]) if rank > 0 else BELOW_EVERY_ERROR


def threshold_rank(N: int, r: Decimal) -> int:
    """The rank of Theta_r among N samples, the first being rank 1; 0 where it lies below all of them.

    Raises ThresholdsError where N = 0 and SettingError where r is not in [0, 1].
    """
    checked(r)
    if N == 0:
        raise ThresholdsError("no clean samples to take theta from", remedy="calibrate on clean recordings")
    return N - _outliers(r, N)


def resolvable(r: Decimal, N: int) -> bool:
    """False where 0 < r < 1/N: with N samples such a rate cannot be told from r = 0."""
    checked(r)
    return r == 0 or _outliers(r, N) > 0


def thresholds_at(
    calibration: Calibration, statistic: Statistic, r: Decimal, *, transferred: bool = False
) -> Thresholds:
    """Thresholds at r, for every triple that the calibration has samples of.

    `transferred` says that the calibration is of another rig kind. Raises ThresholdsError where no triple has samples,
    and SettingError where r is not in [0, 1].
    """
    samples = {
        triple: values
        for (measured, triple), values in calibration.samples.items()
        if measured is statistic and len(values) > 0
    }
    if not samples:
        raise ThresholdsError(
            f"no clean samples of the {statistic} disparity error",
            where=f"calibration {calibration.calibration_id}",
            remedy="calibrate on clean recordings in which at least three sensors overlap",
        )
    return Thresholds(
        calibration_id=calibration.calibration_id,
        statistic=statistic,
        r=r,
        theta={triple: threshold(values, r) for triple, values in samples.items()},
        samples={triple: len(values) for triple, values in samples.items()},
        resolvable=all(resolvable(r, len(values)) for values in samples.values()),
        transferred=transferred,
    )


def check_calibration(
    calibration: Calibration, *, rig_kind: RigKind, procedure: Procedure, transfer: bool = False
) -> Similarity:
    """Refuse thresholds of measurements that were made otherwise; say how alike the rig kinds are.

    A similar kind is accepted, another one only with `transfer`; another matcher, other settings or another counting
    version never are. Raises ThresholdsError that says what differs and what to do.
    """
    where = f"calibration {calibration.calibration_id}"
    differences = list(_differences(calibration.procedure, procedure))
    if differences:
        raise ThresholdsError(
            "its thresholds are for measurements made otherwise: " + ", ".join(differences),
            where=where,
            remedy="calibrate again with the same matcher and settings, or measure again with the calibration's",
        )
    similarity = calibration.part.similarity if calibration.part else calibration.rig_kind.similarity(rig_kind)
    if similarity is Similarity.OTHER and not transfer:
        raise ThresholdsError(
            f"its thresholds are for another rig kind: {calibration.rig_kind}, where this one is {rig_kind}",
            where=where,
            remedy="calibrate on clean recordings of this rig kind, or ask for a transfer, which the verdicts will say",
        )
    return similarity


def _differences(calibrated: Procedure, measured: Procedure) -> Iterator[str]:
    if calibrated.matcher != measured.matcher:
        yield f"matcher {calibrated.matcher}, not {measured.matcher}"
    if calibrated.settings != measured.settings:
        yield f"settings {_differing(calibrated.settings, measured.settings)}"
    if calibrated.counting_version != measured.counting_version:
        yield f"counting version {calibrated.counting_version}, not {measured.counting_version}"


def _differing(calibrated: str, measured: str) -> str:
    """The entries of two settings texts that differ; the texts themselves where they are not JSON objects."""
    try:
        ours, theirs = json.loads(calibrated), json.loads(measured)
    except json.JSONDecodeError:
        return f"{calibrated}, not {measured}"
    if not (isinstance(ours, dict) and isinstance(theirs, dict)):
        return f"{calibrated}, not {measured}"
    names = sorted(name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name))
    return ", ".join(f"{name} {ours.get(name)}, not {theirs.get(name)}" for name in names)


def checked(r: Decimal) -> Decimal:
    """The rate itself. Raises SettingError where it is not in [0, 1]."""
    if not (r.is_finite() and 0 <= r <= 1):
        raise SettingError(f"{r} is not between 0 and 1", where="r", remedy="write it as 0.01 or 1%")
    return r


def _outliers(r: Decimal, N: int) -> int:
    """floor(r N), in arithmetic precise enough to be exact."""
    with localcontext(prec=len(r.as_tuple().digits) + DIGITS_OF_A_COUNT):
        return int((r * N).to_integral_value(ROUND_FLOOR))
