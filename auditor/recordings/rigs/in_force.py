"""Which rig of a recording is in force when.

A camera info, a mounting in tf or the size of pictures may change while a drive is recorded. From then on the recording
is audited with the rig that its calibration gives then. Topics and transforms that no rig needs do not count.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from auditor.model.rig import Camera, Rig
from auditor.model.text import first_few
from auditor.recordings.decoding import CameraInfo, Transform
from auditor.recordings.parameters import CALIBRATION_CHANGES
from auditor.recordings.recording import Recording
from auditor.recordings.rigs.calibrations import same_lens, same_place, same_projection
from auditor.recordings.rigs.cameras import find_views
from auditor.recordings.rigs.changes import WHOLE, Change, Changes, Key, Stretch, Value
from auditor.recordings.rigs.discovery import find_rigs, search_rigs
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.synchronisation.clocks import learn_timing
from auditor.recordings.synchronisation.survey import Survey

CHANGING = "the calibration changes"
NO_RIG = "no rig after a change of the calibration"
TOO_OFTEN = "the calibration changes too often"

_MOST_TOPICS = 4  # in one remark


@dataclass(frozen=True, eq=False)
class RigInForce:
    """A rig, the calibrations that it was made of, and when they are in force; `changes` are why not always.

    `since` is that by which it came into force; empty of a rig of the beginning.
    """

    rig: Rig
    survey: Survey
    stretches: tuple[Stretch, ...] = WHOLE
    changes: tuple[str, ...] = ()
    since: str = ""

    @property
    def reads_along(self) -> bool:
        """Whether its frames can be made in a read for several rigs: it is in force from beginning to end.

        A rig that comes into force later would take in all messages before while the others wait.
        """
        return self.survey.interleaved and len(self.stretches) == 1


class ToldChange(NamedTuple):
    """A change of the calibration in words: `what` changes and when, and what becomes of the frames from `then` on."""

    what: str
    then: str

    def __str__(self) -> str:
        return f"{self.what}: {self.then}"


class RigsInForce(NamedTuple):
    """The rigs of a recording, those of its beginning first; a sentence for each repair of calibrations, and changes.

    `withheld` is why no verdict may be given on any of them, and what to do about it; empty where there is no reason.
    """

    rigs: tuple[RigInForce, ...]
    repairs: tuple[str, ...] = ()
    changes: tuple[ToldChange, ...] = ()
    withheld: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """A sentence for each repair and change."""
        return (*self.repairs, *map(str, self.changes))

    def larger_than(self, rig_in_force: RigInForce) -> Iterator[Rig]:
        """The rigs that have all sensors of one of them, and more, when it is in force."""
        topics = {*map(rig_in_force.rig.topic, rig_in_force.rig.sensors)}
        at_once = (other.rig for other in self.rigs if other.stretches == rig_in_force.stretches)
        return (rig for rig in at_once if topics < {*map(rig.topic, rig.sensors)})


def rigs_in_force(recording: Recording, survey: Survey) -> RigsInForce:
    """The rigs of a recording's beginning, and those that come into force later. The recording is read through.

    Raises RigError where there is no rig at the beginning.
    """
    rigs = find_rigs(survey)
    needed = [_needs(rig, survey) for rig in rigs]
    changes = _changes_of(recording, survey, needed)
    changes.read(recording)
    return _in_force(survey, rigs, needed, changes)


def rigs_unless_changed(recording: Recording, survey: Survey) -> tuple[RigsInForce, Changes]:
    """What `rigs_in_force` gives where no calibration changes, and what finds out that one does; nothing is read.

    Raises RigError where there is no rig at the beginning.
    """
    rigs = find_rigs(survey)
    needed = [_needs(rig, survey) for rig in rigs]
    changes = _changes_of(recording, survey, needed)
    return _in_force(survey, rigs, needed, changes), changes


def _changes_of(recording: Recording, survey: Survey, needed: Sequence[Mapping[Key, int]]) -> Changes:
    return Changes(recording, survey, frozenset[Key]().union(*(needs.keys() for needs in needed)))


def _in_force(
    survey: Survey, rigs: Sequence[Rig], needed: Sequence[Mapping[Key, int]], changes: Changes
) -> RigsInForce:
    by_id: dict[str, RigInForce] = {}
    told: dict[ToldChange, None] = {}
    for rig, needs in zip(rigs, needed, strict=True):
        line = _Line(rig, survey, needs, [other for other in rigs if other is not rig])
        line.follow(changes)
        for rig_in_force in line.in_force():
            by_id.setdefault(rig_in_force.rig.rig_id, rig_in_force)
        told.update(dict.fromkeys(line.told))
    repairs = tuple(dict.fromkeys(_repairs(rigs, survey)))
    return RigsInForce(tuple(by_id.values()), repairs, tuple(told))


def _repairs(rigs: Sequence[Rig], survey: Survey) -> Iterator[str]:
    """What of the calibrations of some rigs had to be put right."""
    topics = {camera.topic for rig in rigs for camera in rig.cameras}
    for view in find_views(survey, []):
        if view.image.topic.name in topics:
            yield from view.repairs
            if blank := survey.blank_infos.get(view.info_topic):
                which = "its first info is" if blank == 1 else f"its first {blank} infos are"
                yield f"{view.info_topic}: {which} zeros; the next one was taken for all frames before it"


def _needs(rig: Rig, survey: Survey) -> Mapping[Key, int]:
    """What a rig depends on, each with the offset of the sensor's clock to the rig's time."""
    offset_ns = learn_timing(rig, survey).offset_ns
    views = {view.image.topic.name: view for view in find_views(survey, [])}
    needs: dict[Key, int] = {}
    frames: list[str] = []
    for camera in rig.cameras:
        needs[Key("size", camera.topic)] = offset_ns[camera.number]
        view = views.get(camera.topic)
        if view is not None:
            needs[Key("info", view.info_topic)] = offset_ns[camera.number]
            frames.append(view.frame_id)
    topics = {lidar.topic for lidar in rig.lidars.values()}
    frames += [cloud.frame_id for cloud in survey.clouds if cloud.topic.name in topics]
    return needs | {Key("transform", *link): 0 for link in _links(survey.transforms, frames)}


def _links(transforms: Sequence[Transform], frames: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The transforms, as parent and child, on the shortest ways from the first of some frames to the others."""
    declared = {(transform.parent, transform.child) for transform in transforms}
    tree = FrameTree(transforms)
    for target in frames[1:]:
        for link in pairwise(tree.chain(frames[0], target) or ()):
            yield link if link in declared else link[::-1]


@dataclass
class _Cluster:
    """Changes that follow one another closely: together they are one change of the rig."""

    changes: list[Change]
    first_ns: int
    last_ns: int


class _Line:
    """The rigs that follow one another from one rig of the beginning."""

    def __init__(self, rig: Rig, survey: Survey, needs: Mapping[Key, int], others: Sequence[Rig]) -> None:
        self._needs = needs
        self._others = others
        self._survey = survey
        self._tolerance_ns = learn_timing(rig, survey).tolerance_ns
        self._known: dict[Rig, Survey] = {rig: survey}
        self._stretches: dict[Rig, list[Stretch]] = {rig: []}
        self._last: tuple[Rig, ...] = (rig,)
        self._of_lidar_alone = not rig.cameras
        samples = survey.samples(rig.topic(rig.n))
        self._begin_ns = min((sample.time_ns for sample in samples), default=0)
        self._changes: list[str] = []
        self._since: dict[Rig, str] = {rig: ""}
        self.told: list[ToldChange] = []

    def in_force(self) -> Iterator[RigInForce]:
        """The rigs with their times."""
        self._leave_out_the_first_if_it_has_no_frame()
        for rig, stretches in self._stretches.items():
            if stretches:
                changes, since = tuple(self._changes), self._since.get(rig, "")
                yield RigInForce(rig, self._known[rig], tuple(stretches), changes, since)

    def _leave_out_the_first_if_it_has_no_frame(self) -> None:
        """A calibration that changed before the first frame was never in force: the next rig has its stretches."""
        first, *others = (rig for rig, stretches in self._stretches.items() if stretches)
        own = self._stretches[first]
        frames = [one for one in own if not one.reason and (one.until_ns is None or one.until_ns > self._begin_ns)]
        if others and not frames:
            self._stretches[others[0]][:0] = [one for one in own if one.reason]
            own.clear()

    def follow(self, changes: Changes) -> None:
        """Follow all changes of the recording."""
        begin_ns: int | None = None
        in_force, reason = self._last, ""
        counted = 0
        for cluster in self._clusters(changes):
            from_ns, until_ns = cluster.first_ns - self._tolerance_ns, cluster.last_ns - self._tolerance_ns
            rigs = self._rigs_after(changes, cluster.last_ns)
            if from_ns == until_ns and (rigs or self._last, "" if rigs else NO_RIG) == (in_force, reason):
                continue  # nothing that the rig is made of has changed
            self._add(in_force, Stretch(begin_ns, from_ns, reason))
            begin_ns = from_ns
            counted += 1
            if counted > CALIBRATION_CHANGES.most:
                self._end(from_ns, cluster)
                return
            if until_ns > from_ns:
                self._add(self._last, Stretch(from_ns, until_ns, CHANGING))
                begin_ns = until_ns
            self._tell(cluster, rigs, settling=until_ns > from_ns)
            in_force, reason = (rigs, "") if rigs else (self._last, NO_RIG)
        self._add(in_force, Stretch(begin_ns, changes.until_ns, reason))
        if changes.until_ns is not None:
            self._add(self._last, Stretch(changes.until_ns, None, TOO_OFTEN))
            self.told.append(ToldChange(TOO_OFTEN, f"frames from {self._at(changes.until_ns)} on are not audited"))

    def _end(self, from_ns: int, cluster: _Cluster) -> None:
        self._add(self._last, Stretch(from_ns, None, TOO_OFTEN))
        reason = f"{TOO_OFTEN}, more than {CALIBRATION_CHANGES.most} times"
        self.told.append(ToldChange(reason, f"frames from {self._at(cluster.first_ns)} on are not audited"))

    def _add(self, rigs: Sequence[Rig], stretch: Stretch) -> None:
        for rig in rigs:
            before = self._stretches[rig]
            if before and before[-1].until_ns == stretch.from_ns and before[-1].reason == stretch.reason:
                before[-1] = replace(before[-1], until_ns=stretch.until_ns)
            else:
                before.append(stretch)
            if stretch.reason:
                return  # it counts once
        if not stretch.reason:
            self._last = tuple(rigs)

    def _tell(self, cluster: _Cluster, rigs: Sequence[Rig], *, settling: bool) -> None:
        topics = list(dict.fromkeys(str(change.key) for change in cluster.changes))
        named = first_few(topics, _MOST_TOPICS)
        then = "have a rig of their own" if rigs else "have no rig"
        if len(rigs) == 1 and len(self._stretches[rigs[0]]) > 0:
            then = "have the rig of before"
        until = f", and again until {self._at(cluster.last_ns)}" if settling else ""
        between = "frames between are not audited, which --rig avoids where one rig does for all; " if settling else ""
        self._changes.append(f"{CHANGING} at {self._at(cluster.first_ns)}{until} ({named})")
        for rig in rigs:
            self._since.setdefault(rig, self._changes[-1])
        self.told.append(ToldChange(self._changes[-1], f"{between}frames from then on {then}"))

    def _at(self, time_ns: int) -> str:
        return f"{(time_ns - self._begin_ns) / 1e9:.1f} s"

    def _clusters(self, changes: Changes) -> Iterator[_Cluster]:
        cluster: _Cluster | None = None
        for change in changes.found:
            if change.key not in self._needs:
                continue
            time_ns = change.time_ns - self._needs[change.key]
            if cluster is not None and time_ns - cluster.last_ns <= CALIBRATION_CHANGES.settling_ns:
                cluster.changes.append(change)
                cluster.first_ns, cluster.last_ns = min(cluster.first_ns, time_ns), max(cluster.last_ns, time_ns)
                continue
            if cluster is not None:
                yield self._narrowed(cluster)
            cluster = _Cluster([change], time_ns, time_ns)
        if cluster is not None:
            yield self._narrowed(cluster)

    def _narrowed(self, cluster: _Cluster) -> _Cluster:
        """Changes within one frame are one moment."""
        if cluster.last_ns - cluster.first_ns <= self._tolerance_ns:
            cluster.last_ns = cluster.first_ns
        return cluster

    def _rigs_after(self, changes: Changes, time_ns: int) -> tuple[Rig, ...]:
        """The rigs that take the place of the last ones, by the calibrations of a time."""
        latest = [c for c in changes.found if c.time_ns - self._needs.get(c.key, 0) <= time_ns + self._tolerance_ns]
        survey = _with(self._survey, {change.key: change.value for change in latest})
        topics = {rig.topic(sensor) for rig in self._known for sensor in rig.sensors}
        rigs: list[Rig] = []
        for rig in search_rigs(survey).rigs:
            if any(_alike(rig, other) for other in self._others) or (rig.n == 0) != self._of_lidar_alone:
                continue
            if not topics & set(map(rig.topic, rig.sensors)):
                continue
            earlier = next((one for one in self._known if _alike(one, rig)), None)
            if earlier is None:
                self._known[rig], self._stretches[rig] = survey, []
            rigs.append(earlier or rig)
        return tuple(rigs)


def _with(survey: Survey, values: Mapping[Key, Value]) -> Survey:
    """A survey with other calibrations."""
    infos = {key.name: value for key, value in values.items() if isinstance(value, CameraInfo)}
    moved = {(value.parent, value.child): value for value in values.values() if isinstance(value, Transform)}
    sizes = {key.name: value for key, value in values.items() if isinstance(value, tuple)}
    return replace(
        survey,
        camera_infos=survey.camera_infos | infos,
        transforms=tuple(moved.get((one.parent, one.child), one) for one in survey.transforms),
        images=tuple(replace(image, size_px=sizes.get(image.topic.name, image.size_px)) for image in survey.images),
    )


def _alike(a: Rig, b: Rig) -> bool:
    """True for two rigs of the same sensors at the same places."""
    if [a.topic(sensor) for sensor in a.sensors] != [b.topic(sensor) for sensor in b.sensors]:
        return False
    places = zip(a.lidars.values(), b.lidars.values(), strict=False)
    if not all(same_place(one.rig_SE3_lidar, other.rig_SE3_lidar) for one, other in places):
        return False
    return all(_same_camera(one, other) for one, other in zip(a.cameras, b.cameras, strict=True))


def _same_camera(a: Camera, b: Camera) -> bool:
    plain = [(one.width_px, one.height_px, one.rectified, one.lens.model) for one in (a, b)]
    lenses = same_lens(a.lens.coefficients, b.lens.coefficients)
    return plain[0] == plain[1] and lenses and same_projection(a.projection, b.projection)
