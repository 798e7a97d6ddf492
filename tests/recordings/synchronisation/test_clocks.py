"""Sensors whose clocks are not those of the others, and cameras that do not expose together."""

from collections.abc import Mapping
from dataclasses import replace

import pytest

from auditor.model.rig import Rig
from auditor.recordings.recording import Topic
from auditor.recordings.synchronisation.clocks import learn_timing
from auditor.recordings.synchronisation.survey import CloudTopic, ImageTopic, Sample, Survey
from tests.making.recorded_drives import make_rig

RIG = make_rig(3)
START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
MS = 10**6


def surveyed(ahead_ns: Mapping[int, int], later_ns: Mapping[int, int], rig: Rig = RIG) -> Survey:
    """Stamps of clocks that are ahead by so much, of messages that are also recorded later by so much."""

    def samples(sensor: int) -> tuple[Sample, ...]:
        times = (START_NS + number * PERIOD_NS + later_ns.get(sensor, 0) for number in range(20))
        return tuple(Sample(time_ns + ahead_ns.get(sensor, 0), time_ns) for time_ns in times)

    images = tuple(
        ImageTopic(Topic(camera.topic, "", "cdr"), camera.name, (64, 48), samples(camera.number))
        for camera in rig.cameras
    )
    clouds = (CloudTopic(Topic(rig.topic(0), "", "cdr"), "top", 100, samples(0)),)
    return Survey((), images, clouds, {}, (), (), interleaved=True)


@pytest.mark.parametrize("sensor", [0, 1, 3])
@pytest.mark.parametrize("ahead_ns", [-START_NS + 4321 * 10**9, 37 * 10**9 + 13 * MS])
def test_a_clock_of_another_time_is_put_with_the_others_by_the_times_of_recording(sensor: int, ahead_ns: int) -> None:
    timing = learn_timing(RIG, surveyed({sensor: ahead_ns}, {}))
    assert timing.offset_ns == {number: ahead_ns if number == sensor else 0 for number in RIG.sensors}
    [remark] = timing.remarks
    assert RIG.topic(sensor) in remark
    assert ("ahead of" if ahead_ns > 0 else "behind") in remark
    assert f" {ahead_ns / 1e9:+.3f} s, by 20 messages" in remark


def test_a_clock_that_is_ahead_is_not_guessed_where_nothing_was_recorded_in_time() -> None:
    """All log times are those of a copy: they show nothing of the stamps, which stay as they are."""
    survey = surveyed({0: 37 * 10**9}, {})
    clouds = tuple(
        replace(c, samples=tuple(s._replace(log_time_ns=START_NS) for s in c.samples)) for c in survey.clouds
    )
    assert learn_timing(RIG, replace(survey, clouds=clouds)).remarks == ()


def test_the_usual_delays_are_no_other_clock() -> None:
    timing = learn_timing(RIG, surveyed({0: -150 * MS}, {}))
    assert timing.remarks == ()
    assert timing.offset_ns[0] == pytest.approx(50 * MS, abs=PERIOD_NS)


@pytest.mark.parametrize(("apart_ms", "withheld"), [(20, False), (45, False), (60, True), (99, True)])
def test_cameras_that_expose_too_far_apart_are_not_compared(apart_ms: int, withheld: bool) -> None:
    timing = learn_timing(RIG, _every_second(surveyed({}, {1: apart_ms * MS})))
    assert bool(timing.withheld) is withheld
    if withheld:
        assert timing.withheld.startswith(f"exposures {apart_ms} ms apart: cam1 and ")


def test_a_camera_whose_clock_alone_is_off_is_compared() -> None:
    assert learn_timing(RIG, _every_second(surveyed({1: 90 * MS}, {}))).withheld == ""


def test_a_lidar_beside_the_exposures_is_compared() -> None:
    assert learn_timing(RIG, _every_second(surveyed({}, {0: 90 * MS}))).withheld == ""


@pytest.mark.parametrize("ahead_ms", [200, 300, 500, 1900])
@pytest.mark.parametrize("sensor", [0, 1, 3])
def test_stamps_of_after_their_recording_are_of_another_clock(sensor: int, ahead_ms: int) -> None:
    timing = learn_timing(RIG, surveyed({sensor: ahead_ms * MS}, {}))
    assert timing.offset_ns[sensor] == ahead_ms * MS
    assert timing.withheld == ""
    assert len(timing.remarks) == 1


@pytest.mark.parametrize("behind_ms", [200, 300, 800, 1900])
@pytest.mark.parametrize("sensor", [0, 1, 3])
def test_a_sensor_whose_stamps_are_much_older_than_the_others_is_not_compared(sensor: int, behind_ms: int) -> None:
    timing = learn_timing(RIG, surveyed({sensor: -behind_ms * MS}, {}))
    assert timing.remarks == ()
    assert timing.withheld.startswith(
        f"the stamps of {RIG.name(sensor)} lie {behind_ms / 1e3:.2f} s before its log times, those of the others 0.00 s"
    )


def test_a_recorder_whose_clock_is_behind_tells_nothing_of_one_sensor() -> None:
    timing = learn_timing(RIG, surveyed({0: 400 * MS, 1: 400 * MS, 2: 400 * MS, 3: 900 * MS}, {}))
    assert timing.remarks == ()
    assert "cam3 lie 0.90 s after its log times, those of the others 0.40 s after theirs" in timing.withheld


def test_latencies_and_an_offset_that_a_rig_gives_withhold_nothing() -> None:
    usual = {0: -110 * MS, 1: -150 * MS, 2: -10 * MS, 3: -10 * MS}
    assert learn_timing(RIG, surveyed(usual, {})).withheld == ""
    assert RIG.lidar is not None
    known = replace(RIG, lidar=replace(RIG.lidar, offset_ns=-300 * MS))
    timing = learn_timing(known, surveyed({0: -300 * MS}, {}, known))
    assert (timing.withheld, timing.offset_ns[0]) == ("", -300 * MS)


@pytest.mark.parametrize("leap_ns", [37 * 10**9, -37 * 10**9])
@pytest.mark.parametrize("first", [3, 10, 16])
@pytest.mark.parametrize("sensor", [0, 3])
def test_stamps_that_leap_leave_a_sensor_where_its_log_times_are(sensor: int, first: int, leap_ns: int) -> None:
    whole = surveyed({}, {})
    leaping = _leaping(whole, RIG.topic(sensor), first, leap_ns)
    timing = learn_timing(RIG, leaping)
    check = timing.stamp_check(sensor)
    placed = [check.place(*one).time_ns - timing.offset_ns[sensor] for one in leaping.samples(RIG.topic(sensor))]
    assert placed == [one.log_time_ns for one in whole.samples(RIG.topic(sensor))]


def test_a_recorder_that_falls_behind_withholds_nothing_and_counts_against_no_stamp() -> None:
    """Every message is written a period later after its stamp than the one before."""
    slow = surveyed({}, {})
    clouds = tuple(replace(c, samples=_falling_behind(c.samples)) for c in slow.clouds)
    images = tuple(replace(i, samples=_falling_behind(i.samples)) for i in slow.images)
    timing = learn_timing(RIG, replace(slow, images=images, clouds=clouds))
    check = timing.stamp_check(0)
    assert {check.place(*one).against for one in clouds[0].samples} == {""}
    assert (timing.withheld, timing.remarks) == ("", ())


def _falling_behind(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
    return tuple(Sample(one.stamp_ns, one.log_time_ns + n * PERIOD_NS) for n, one in enumerate(samples))


def _leaping(survey: Survey, topic: str, first: int, leap_ns: int) -> Survey:
    def leap(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        return (*samples[:first], *(one._replace(stamp_ns=one.stamp_ns + leap_ns) for one in samples[first:]))

    images = tuple(replace(i, samples=leap(i.samples)) if i.topic.name == topic else i for i in survey.images)
    clouds = tuple(replace(c, samples=leap(c.samples)) if c.topic.name == topic else c for c in survey.clouds)
    return replace(survey, images=images, clouds=clouds)


def _every_second(survey: Survey) -> Survey:
    """The same sensors at half their rate."""
    images = tuple(ImageTopic(one.topic, one.frame_id, one.size_px, one.samples[::2]) for one in survey.images)
    clouds = tuple(CloudTopic(one.topic, one.frame_id, one.points, one.samples[::2]) for one in survey.clouds)
    return Survey((), images, clouds, {}, (), (), interleaved=True)
