"""Attacks in memory: the same counts as measuring the attacked frame, and nothing measured twice."""

import json
from dataclasses import replace
from itertools import combinations, islice, pairwise

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from auditor.cli import auditor
from auditor.errors import RecordingError, RigError, SettingError
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.evaluation import (
    EvaluateTask,
    RecordingSource,
    Street,
    evaluate_source,
    experiments_of,
    runner,
)
from auditor.lab.evaluation import sources as clean_recordings
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import EXPERIMENTS, LIGHTS, SeededDraws, attacked_sets, disc_share
from auditor.lab.evaluation.features import FeaturesOfCases
from auditor.lab.evaluation.runner import CHUNK_FRAMES
from auditor.measurement import measure
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import CAMERA_CHECKS, DIRECTION_CHECKS, LIDAR_CHECKS, Check, rig_sensor_checks
from auditor.model.measurement import Procedure
from auditor.model.rig import LIDAR, Triple
from auditor.model.verdict import AttackLabel
from auditor.recordings import write_mcap
from auditor.store.evaluation_tables import INTERVAL_FRAMES, CaseFeatures, EvaluationPart
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.matchers import WholeRange
from tests.making.scenes import plane_frame, plane_rig
from tests.making.small_drives import FOUR_CAMERAS, drive_frames, write_drive

RIG = plane_rig(FOUR_CAMERAS)
FACULAS = {s: Facula(2000.0, 20.0 + 5 * s, 60.0 * s, 50.0) for s in (1, 2, 3, 4)}
ATTACKS = {LIDAR: BogusWall(range_m=6.0, lateral_m=0.2, seed=3), **FACULAS}
FRAMES = 5
CHUNK = 2
SHORTER = 2


class CountingMatcher:
    """SGBM that counts its calls."""

    def __init__(self):
        self.calls = 0
        self._sgbm = WholeRange()

    def __getattr__(self, name):
        return getattr(self._sgbm, name)

    def match(self, left, right):
        self.calls += 1
        return self._sgbm.match(left, right)


def under_attacks(frame, attacks):
    images = {s: attacks[s].apply(i) if s in attacks else i for s, i in frame.images.items()}
    return replace(frame, images=images, cloud=attacks[0].apply(frame.cloud, RIG) if 0 in attacks else frame.cloud)


def test_an_attacked_frame_gives_the_counts_and_statistics_of_measuring_it():
    frame, matcher = plane_frame(RIG, depth_m=7.0), find_matcher("sgbm")
    attacked_frame = AttackedFrame(frame, RIG, matcher)
    found = []
    for size in (0, 1, 2, 3):
        for attacked in combinations(RIG.sensors, size):
            attacks = {s: ATTACKS[s] for s in attacked}
            measured, _ = measure(under_attacks(frame, attacks), RIG, matcher)
            assert attacked_frame.counts(attacks) == measured.counts
            found.append(attacked_frame.statistics(attacks))
            assert found[-1] == sensor_statistics(rig_sensor_checks(RIG), measured.cells, measured.shares)
    assert len(set(found)) >= len(found) - 2  # where all cameras are blinded none can check the LiDAR


def test_only_what_an_attack_changes_is_matched_again():
    matcher = CountingMatcher()
    attacked_frame = AttackedFrame(plane_frame(RIG), RIG, matcher)
    calls = []
    for attacked in ((), (0,), (1,), (0, 1), (4,), (1, 4), (0, 1, 4)):
        attacked_frame.counts({s: ATTACKS[s] for s in attacked})
        calls.append(matcher.calls)
    # 6 pairs: every two cameras. A camera is in three of them, S_1 and S_4 both in one.
    assert [b - a for a, b in pairwise([0, *calls])] == [6, 0, 3, 0, 3, 1, 0]
    attacked_frame.forget_attacks()
    attacked_frame.counts({})
    assert matcher.calls == calls[-1]
    attacked_frame.counts({1: ATTACKS[1]})
    assert matcher.calls == calls[-1] + 3


def test_a_matcher_of_many_pairs_gets_those_of_all_cases_at_once_and_none_twice():
    matched = []

    class Pairing(CountingMatcher):
        pairs_at_once = 1

        def match_pairs(self, images, pairs):
            matched.append(len(pairs))
            return [self.match(images[left], images[right]) for left, right in pairs]

    frame, matcher = plane_frame(RIG, depth_m=7.0), Pairing()
    attacked_frame = AttackedFrame(frame, RIG, matcher)
    cases = [{}, {1: ATTACKS[1]}, {0: ATTACKS[0], 1: ATTACKS[1]}, {1: ATTACKS[1], 4: ATTACKS[4]}]
    attacked_frame.match_together(cases)
    # 6 pairs; S_1 in three of them, S_4 in three, both in one.
    assert (matched, matcher.calls) == ([6 + 3 + 3], 12)
    plain = AttackedFrame(frame, RIG, WholeRange())
    assert [attacked_frame.counts(case) for case in cases] == [plain.counts(case) for case in cases]
    attacked_frame.match_together(cases)
    assert (sum(matched), matcher.calls) == (12, 12)


def test_a_triple_that_was_not_requested_or_lacks_a_sensor_has_no_counts():
    attacked_frame = AttackedFrame(plane_frame(RIG, without=frozenset({2})), RIG, find_matcher("sgbm"))
    assert attacked_frame.sensors == (0, 1, 3, 4)
    counts = dict(zip(RIG.measured_triples, attacked_frame.counts({}, [Triple(0, 1, 4), Triple(0, 2, 4)]), strict=True))
    assert [t for t, c in counts.items() if c] == [Triple(0, 1, 4)]


def test_statistics_are_those_of_the_requested_triples_whose_sensors_are_there():
    matcher = find_matcher("sgbm")
    attacked_frame = AttackedFrame(plane_frame(RIG), RIG, matcher)
    asked = {
        check
        for check, x in zip(attacked_frame.sensor_checks, attacked_frame.statistics({}, [Triple(0, 1, 4)]), strict=True)
        if x is not None
    }
    of_pictures = (Check.STRIPED_LIGHT, Check.VEILING_LIGHT, Check.UNMATCHED_LIGHT, Check.ADDED_TEXTURE)
    of_cameras = (*CAMERA_CHECKS, *of_pictures)
    assert asked == {
        *(c for c in rig_sensor_checks(RIG) if c.check in DIRECTION_CHECKS and {1, 4} <= set(c.others)),
        *((check, camera, (5 - camera,)) for check in of_cameras for camera in (1, 4)),
        *((check, LIDAR, (4,)) for check in LIDAR_CHECKS),
    }
    for missing in ({0}, {2}, {0, 4}):
        frame = plane_frame(RIG, without=frozenset(missing))
        measured, _ = measure(frame, RIG, matcher)
        everything = sensor_statistics(rig_sensor_checks(RIG), measured.cells, measured.shares)
        assert AttackedFrame(frame, RIG, matcher).statistics({}) == everything


def test_all_seven_combinations_of_every_triple_are_tried_and_all_pairs_that_can_be_identified():
    assert len(attacked_sets(plane_rig(FOUR_CAMERAS))) == 5 + 10 + 6
    assert len(attacked_sets(plane_rig((0.6, 0.3, 0.0)))) == 4 + 6 + 3
    assert len(attacked_sets(plane_rig((0.6, 0.0)))) == 7
    assert len(attacked_sets(plane_rig((0.6, 0.3, 0.0), lidar=False))) == 7


def test_one_sensors_attack_is_the_same_in_every_combination_and_place_and_size_do_not_depend_on_strength():
    experiment = next(e for e in EXPERIMENTS if e.name == "combinations")
    cases = list(experiment.cases(RIG, SeededDraws(0, 1, 2, 3), ()))
    for strength in ("mild", "strong", "opaque"):
        of_it = [case for case in cases if case.strength == strength]
        assert [case.attacked for case in of_it] == list(attacked_sets(RIG))
        assert len({case.attacks[1] for case in of_it if 1 in case.attacks}) == 1
    faculas = {case.attacks[1] for case in cases if case.attacked == (1,)}
    assert {f.amplitude for f in faculas} == {255.0, 510.0, 2000.0}
    assert len({(f.radius_px, f.u_px, f.v_px) for f in faculas}) == 1
    assert len({case.attacks[0] for case in cases if case.attacked == (0,)}) == 1
    assert list(experiment.cases(RIG, SeededDraws(0, 1, 2, 4), ()))[1].attacks != cases[1].attacks


def test_sensitivity_varies_walls_and_the_faculas_of_reference_and_source_camera():
    experiment = next(e for e in EXPERIMENTS if e.name == "sensitivity")
    cases = list(experiment.cases(RIG, SeededDraws(0, 1, 2, 0), ()))
    assert [c.size for c in cases if c.attacked == (0,)] == [0.5, 1.0, 1.5, 2.0, 2.5]
    for sensor in (1, 4):
        sizes = [c.size for c in cases if c.attacked == (sensor,) and c.strength == "mild"]
        assert sizes == [37.5, 75.0, 112.5, 150.0, 187.5, 225.0]
    assert experiment.triples(RIG) == (Triple(0, 1, 4),)
    assert list(experiment.cases(plane_rig(lidar=False), SeededDraws(0, 1, 2, 0), ())) == []


def test_the_visible_share_is_that_of_the_disc_inside_the_image():
    assert disc_share(Facula(255, 10, 50, 50), 100, 100) == pytest.approx(np.pi / 100, rel=0.02)
    assert disc_share(Facula(255, 10, 0, 50), 100, 100) == pytest.approx(np.pi / 200, rel=0.1)
    assert disc_share(Facula(255, 500, 50, 50), 100, 100) == 1.0


def run(drive, store, **task):
    return evaluate_source(EvaluateTask(RecordingSource(drive), store, **task), lambda what, done: None)


def content(store):
    """Everything that was counted, without when."""
    return run_sql(Store.open(store), "SELECT * FROM cases ORDER BY ALL").to_pylist()


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drive") / "clean.mcap", FRAMES, positions_m=(0.6, 0.3, 0.0))


@pytest.fixture(scope="module")
def shorter(tmp_path_factory):
    """A drive that is just long enough for a delay."""
    return write_drive(tmp_path_factory.mktemp("shorter") / "clean.mcap", SHORTER, positions_m=(0.6, 0.3, 0.0))


@pytest.fixture
def clean_and_patterns(monkeypatch):
    """Nothing else is tried."""
    monkeypatch.setattr(
        runner, "experiments_of", lambda paths: [e for e in experiments_of(paths) if e.name in ("clean", "patterns")]
    )


@pytest.fixture
def short_chunks(monkeypatch):
    monkeypatch.setattr(runner, "CHUNK_FRAMES", CHUNK)


def few_in_short_chunks(patched, each=12):
    """A share of each experiment's cases in short chunks; intervals end with these, as long ones with long chunks."""

    def few(experiment):
        together = min(experiment.together, CHUNK)
        return replace(
            experiment, together=together, cases=lambda *drawn: islice(experiment.cases(*drawn), None, None, each)
        )

    chosen = tuple(few(one) for one in experiments_of(()))
    patched.setattr(runner, "CHUNK_FRAMES", CHUNK)
    patched.setattr(runner, "experiments_of", lambda _: chosen)


@pytest.fixture
def few_cases(monkeypatch):
    few_in_short_chunks(monkeypatch)


@pytest.fixture(scope="module")
def in_chunks(drive, tmp_path_factory):
    """A store with few cases of every other frame, in short chunks, and the result of evaluating."""
    store = tmp_path_factory.mktemp("chunks")
    with pytest.MonkeyPatch.context() as patched:
        few_in_short_chunks(patched)
        done = run(drive, store, attack_every=2)
    assert {"delay", "facula", "wall"} <= {case["attack"] for case in content(store)}
    return store, done


@pytest.fixture
def nothing_measured(monkeypatch):
    """Cases without counts: which there are takes no matching."""
    monkeypatch.setattr(AttackedFrame, "counts", lambda frame, *_: [None] * len(frame.rig.measured_triples))
    monkeypatch.setattr(AttackedFrame, "statistics", lambda frame, *_: [None] * len(frame.sensor_checks))
    none = CaseFeatures([], [], {}, [], [])
    monkeypatch.setattr(FeaturesOfCases, "of", lambda *_: none)


@pytest.mark.usefixtures("nothing_measured")
def test_every_case_of_every_frame_is_measured_and_none_again(shorter, tmp_path):
    store = tmp_path / "audit"
    done = run(shorter, store)
    delayed = 3 * sum(max(SHORTER - delay, 0) for delay in (1, 3, 10))
    ladders = 3 * (7 + 7 + 6 + 6 + 4) + 2 * 6 + 4
    once = SHORTER * (1 + 3 * 13 + 5 + 44 + 9 + 2 * 7 + 3 * 5)
    assert (done.frames, done.cases) == (SHORTER, once + delayed + ladders)
    assert not run(shorter, store).fresh


@pytest.mark.usefixtures("few_cases")
def test_an_evaluation_that_was_killed_goes_on_where_it_was_and_counts_the_same(
    drive, in_chunks, tmp_path, monkeypatch
):
    store, whole = in_chunks
    killed_at = 3
    measured = []

    def counts(attacked_frame, *arguments, really=AttackedFrame.counts):
        measured.append(attacked_frame.frame.number)
        if len(set(measured)) > killed_at:
            raise KeyboardInterrupt
        return really(attacked_frame, *arguments)

    with monkeypatch.context() as patched:
        patched.setattr(AttackedFrame, "counts", counts)
        with pytest.raises(KeyboardInterrupt):
            run(drive, tmp_path / "killed", attack_every=2)
    assert 0 < len(content(tmp_path / "killed")) < whole.cases
    again = run(drive, tmp_path / "killed", attack_every=2)
    assert again.frames == FRAMES - CHUNK
    assert content(tmp_path / "killed") == content(store)


@pytest.mark.usefixtures("few_cases")
def test_shares_of_a_recording_make_the_whole(drive, in_chunks, tmp_path):
    done = [run(drive, tmp_path / "shared", attack_every=2, share=share, of=2) for share in (0, 1)]
    assert [one.frames for one in done] == [CHUNK + 1, CHUNK]
    assert content(tmp_path / "shared") == content(in_chunks[0])
    assert not run(drive, tmp_path / "shared", attack_every=2, share=1, of=3).fresh


@pytest.mark.usefixtures("nothing_measured")
def test_another_seed_draws_other_attacks_and_measures_no_clean_frame_again(drive, tmp_path):
    first = run(drive, tmp_path / "audit", attack_every=4)
    second = run(drive, tmp_path / "audit", attack_every=4, seed=1)
    assert second.cases == first.cases - FRAMES
    sql = "SELECT DISTINCT parameters FROM cases WHERE attacked = [1] AND strength = 'mild' AND frame = 0"
    drawn = [json.loads(row["parameters"])["S_1"] for row in run_sql(Store.open(tmp_path / "audit"), sql).to_pylist()]
    assert len({one["u_px"] for one in drawn if one["radius_px"] > 0}) >= 2


@pytest.mark.usefixtures("short_chunks", "nothing_measured")
def test_every_frame_is_measured_clean_and_each_nth_attacked_as_it_would_be_alone(drive, tmp_path):
    def cases(store):
        columns = "frame, experiment, draw, attacked, attack, strength, size, parameters"
        return run_sql(Store.open(store), f"SELECT {columns} FROM cases ORDER BY ALL").to_pylist()

    run(drive, tmp_path / "some", attack_every=4)
    assert not run(drive, tmp_path / "some", attack_every=4).fresh
    run(drive, tmp_path / "all")
    some, everything = cases(tmp_path / "some"), cases(tmp_path / "all")
    kept = [case for case in everything if case["experiment"] in ("clean", "intervals") or case["frame"] in (0, 4)]
    assert some == kept
    assert run(drive, tmp_path / "some").cases > 0  # the same attacks in more frames
    assert cases(tmp_path / "some") == everything  # and nothing twice


def test_the_id_of_a_part_follows_from_all_that_determines_its_attacks():
    first = EvaluationPart(
        recording_id="a" * 64,
        name="a",
        synthetic=False,
        rig_id="rig",
        procedure=Procedure("sgbm", "{}"),
        experiment="combinations",
        seed=0,
        draws=1,
        chunk=0,
        attack_every=1,
    )
    others = [replace(first, **one) for one in ({"attack_every": 10}, {"experiments_version": 0}, {"seed": 1})]
    assert len({part.evaluation_id for part in (first, *others)}) == 4


def test_a_recording_with_labels_of_attacks_is_refused(tmp_path):
    rig = plane_rig((0.6, 0.3, 0.0))
    label = AttackLabel(rig.topic(1), "facula", 0, 2**60, {})
    path = tmp_path / "attacked.mcap"
    write_mcap(path, rig, drive_frames(rig, 3), [label])
    with pytest.raises(RecordingError, match="labels of attacks"):
        run(path, tmp_path / "audit")


@pytest.mark.usefixtures("few_cases")
def test_every_rig_of_a_recording_is_evaluated_into_parts_of_its_own(tmp_path, monkeypatch):
    path = write_drive(tmp_path / "drive.mcap", count=2, positions_m=(0.6, 0.3, 0.0))
    find = clean_recordings.rigs_through

    def with_and_without_lidar(*arguments):
        found = find(*arguments)
        (one,) = found.rigs
        return found._replace(rigs=(one, replace(one, rig=replace(one.rig, lidar=None))))

    monkeypatch.setattr(clean_recordings, "rigs_through", with_and_without_lidar)
    task = EvaluateTask(RecordingSource(path), tmp_path / "audit", attack_every=2)
    first = evaluate_source(task, lambda what, done: None)
    assert first.frames == 4
    store = Store.open(tmp_path / "audit")
    parts = run_sql(store, "SELECT rig_id, count(*) AS parts FROM evaluations GROUP BY rig_id").to_pylist()
    assert {part["rig_id"] for part in parts} == set(store.ids("rigs"))
    assert len(parts) == 2
    assert not evaluate_source(task, lambda what, done: None).fresh


def test_a_street_is_opened_without_making_a_frame():
    with Street(7, 3).open() as (street,):
        assert (street.synthetic, street.rig.n) == (True, 3)
    with Street(8, 3).open() as (other,):
        assert other.recording_id != street.recording_id


def test_a_rig_without_triples_is_refused_before_anything_is_kept(tmp_path):
    with pytest.raises(RigError, match="street 7: no triple possible: the rig has 1 camera and a LiDAR; evaluate on"):
        evaluate_source(EvaluateTask(Street(7, 3, cameras=1), tmp_path / "audit"), lambda what, done: None)
    assert Store.open(tmp_path / "audit").ids("rigs") == Store.open(tmp_path / "audit").ids("evaluations") == []


def test_the_command_measures_nothing_again_and_prints_the_summary(shorter, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        few_in_short_chunks(patched, each=9)
        run(shorter, tmp_path / "audit")  # here: the command, which has processes of its own, would try all
    arguments = ["evaluate", str(shorter), "--store", str(tmp_path / "audit"), "--jobs", "1", "--format", "json"]
    first = CliRunner().invoke(auditor, arguments)
    assert first.exit_code == 0, first.stderr
    rows = json.loads(first.stdout)
    assert {(row["method"], row["left_out"], row["drives"]) for row in rows} == {
        ("paper", "nothing", 1),
        ("robust", "nothing", 1),
        ("robust", "block", 0),  # two frames are one block
        ("robust", "recording", 0),
    }
    assert all(row["clean_frames"] == 2 and 0 <= row["not_clean"] <= 1 for row in rows)
    assert all(0 <= row[name] <= 1 for row in rows for name in ("scenario_1", "scenario_2", "one_of_3", "misnamed"))
    second = CliRunner().invoke(auditor, arguments)
    assert "measured before" in second.stderr
    assert json.loads(second.stdout) == rows
    alone = CliRunner().invoke(auditor, [*arguments, "--leave-out", "family"])
    # No other recording gives thresholds: the robust method has its prior, the paper's nothing.
    assert {(row["method"], row["left_out"], row["drives"]) for row in json.loads(alone.stdout)} == {
        ("robust", "recording", 0)
    }


def test_the_command_needs_recordings_or_streets():
    refused = CliRunner().invoke(auditor, ["evaluate"], standalone_mode=False)
    assert "name clean recordings, or give --synthetic" in str(refused.exception)


@pytest.mark.usefixtures("short_chunks", "nothing_measured")
def test_a_delayed_sensor_shows_earlier_frames_across_chunks(drive, tmp_path):
    run(drive, tmp_path / "audit")
    sql = "SELECT frame, size FROM cases WHERE attack = 'delay' AND attacked = [0] ORDER BY ALL"
    rows = [tuple(row.values()) for row in run_sql(Store.open(tmp_path / "audit"), sql).to_pylist()]
    assert rows == [(f, float(d)) for f in range(FRAMES) for d in (1, 3) if d <= f]


def test_cases_that_are_not_random_come_with_the_first_draw_only():
    experiment = next(e for e in experiments_of(()) if e.name == "further")
    first, second = (list(experiment.cases(RIG, SeededDraws(0, 1, 2, draw), ())) for draw in (0, 1))
    certain = {"turned LiDAR", "shifted camera", "veil"}
    assert {case.attack for case in first} - {case.attack for case in second} == certain
    assert len(second) == len([case for case in first if case.attack not in certain])
    assert not {tuple(case.attacks.items()) for case in first} & {tuple(case.attacks.items()) for case in second}


def test_kinds_of_light_are_tried_on_the_outermost_cameras():
    experiment = next(e for e in experiments_of(()) if e.name == "further")
    found = {(case.strength, case.attacked) for case in experiment.cases(RIG, SeededDraws(0, 1, 2, 0), ())}
    assert {(kind, (sensor,)) for kind in (*LIGHTS, None) for sensor in (1, 4)} <= found


def test_an_attack_of_a_second_holds_still_or_moves_and_one_that_lasts_is_the_same_all_along():
    assert CHUNK_FRAMES % INTERVAL_FRAMES == 0
    experiment = next(e for e in experiments_of(()) if e.name == "intervals")
    first, next_one, later = (list(experiment.cases(RIG, SeededDraws(0, 1, f, 0), ())) for f in (0, 1, INTERVAL_FRAMES))
    for case, after, other in zip(first, next_one, later, strict=True):
        assert (case.attacks == after.attacks) == (case.strength != "moving")
        assert (case.attacks == other.attacks) == (case.strength == "lasting")
    sets = [(0,), (1,), (2,), (3,), (4,), (0, 4)]
    assert [(c.strength, c.attacked) for c in first] == [(v, s) for v in ("still", "moving", "lasting") for s in sets]
    assert [f for f in range(40) if experiment.takes(f, 2)] == [*range(10), *range(20, 30)]


@pytest.mark.usefixtures("clean_and_patterns")
def test_laser_patterns_are_laid_over_every_camera_and_measured_once(shorter, tmp_path):
    picture = tmp_path / "laser.png"
    light = np.zeros((60, 160, 3), dtype=np.uint8)
    light[20:40] = 255
    picture.write_bytes(cv2.imencode(".png", light)[1].tobytes())
    run(shorter, tmp_path / "audit")
    added = run(shorter, tmp_path / "audit", patterns=(picture,))
    assert added.cases == SHORTER * 3
    assert not run(shorter, tmp_path / "audit", patterns=(picture,)).fresh
    rows = run_query(Store.open(tmp_path / "audit"), "evaluation_further", {"r": "0"}).to_pylist()
    patterns = [row for row in rows if row["attack"] == "pattern"]
    assert {row["variant"] for row in patterns} == {"/".join(picture.parts[-3:])}
    assert [row["attacked"] for row in patterns] == [[1], [2], [3]]
    assert all(row["detected"] == row["cases"] == SHORTER for row in patterns)


def test_a_file_that_is_not_a_picture_is_refused_as_a_pattern(tmp_path):
    (tmp_path / "laser.png").write_bytes(b"no picture")
    with pytest.raises(SettingError, match="not a readable picture"):
        experiments_of([tmp_path / "laser.png"])
