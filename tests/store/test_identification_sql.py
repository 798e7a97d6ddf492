"""Algorithm 2, theta and verdicts in SQL agree with their Python forms."""

import random
from decimal import Decimal
from itertools import product

import pytest

from auditor.identification.cross_validation import wilson
from auditor.identification.paper import codeword, disagreements, identify
from auditor.identification.thresholds import resolvable, threshold
from auditor.model.rig import triples_of
from auditor.store.connection import connected
from tests.identification.definitions import allowed_attack_sets

TRIPLE = "STRUCT(i TINYINT, j TINYINT, k TINYINT)[]"


@pytest.fixture(scope="module")
def connection():
    with connected(None) as connection:
        yield connection


def named_in_sql(connection, patterns, triples):
    values = [{"i": t.i, "j": t.j, "k": t.k} for t in triples]
    rows = connection.execute(
        f"WITH given AS (SELECT unnest($patterns) AS e, $triples::{TRIPLE} AS triples) "
        "SELECT e, named, explains(named, e, triples) FROM algorithm2(given)",
        {"patterns": patterns, "triples": values},
    ).fetchall()
    return {e: (None if named is None else tuple(named), explained) for e, named, explained in rows}


def named_in_python(e, triples):
    system = {sensor for triple, state in zip(triples, e, strict=True) if state != "-" for sensor in triple}
    if not system:
        return None
    found = identify(e, triples, system)
    return None if found.undetermined else found.attacked


def assert_agreement(connection, patterns, triples):
    answers = named_in_sql(connection, patterns, triples)
    assert answers.keys() == set(patterns)
    for e, (named, explained) in answers.items():
        assert named == named_in_python(e, triples), e
        assert explained == (None if named is None else disagreements(e, named, triples) == 0), e


@pytest.mark.parametrize(
    ("n", "lidar"), [(2, True), (3, True), (3, False), (4, False)], ids=["0-2", "0-3", "1-3", "1-4"]
)
def test_it_agrees_on_every_pattern_also_with_unmeasured_elements(connection, n, lidar):
    triples = triples_of(n, lidar=lidar)
    assert_agreement(connection, ["".join(e) for e in product("01-", repeat=len(triples))], triples)


def test_it_agrees_on_all_512_patterns_of_four_cameras_and_many_with_unmeasured_elements(connection):
    triples = triples_of(4, lidar=True)
    complete = ["".join(e) for e in product("01", repeat=9)]
    assert len(complete) == 512
    some = random.Random(4).sample(["".join(e) for e in product("01-", repeat=9)], 1500)
    assert_agreement(connection, sorted({*complete, *some}), triples)


@pytest.mark.parametrize("lidar", [True, False])
@pytest.mark.parametrize("n", [5, 6, 8])
def test_it_agrees_on_disturbed_codewords_of_many_cameras(connection, n, lidar):
    triples = triples_of(n, lidar=lidar)
    draw = random.Random(n)
    patterns = set()
    for attacked in allowed_attack_sets(range(0 if lidar else 1, n + 1)):
        e = codeword(attacked, triples)
        patterns |= {e, "".join(draw.choice("01-") if draw.random() < 0.08 else state for state in e)}
    assert_agreement(connection, sorted(patterns), triples)


@pytest.mark.parametrize("lidar", [True, False])
def test_every_allowed_attack_is_named_from_its_codeword(connection, lidar):
    for n in (4, 5, 7):
        triples = triples_of(n, lidar=lidar)
        attacks = {codeword(attacked, triples): attacked for attacked in allowed_attack_sets(range(not lidar, n + 1))}
        answers = named_in_sql(connection, list(attacks), triples)
        assert {e: named for e, (named, _) in answers.items()} == attacks


def test_no_pattern_at_all_gives_no_answer(connection):
    assert named_in_sql(connection, [], triples_of(3, lidar=True)) == {}


def test_theta_in_sql_is_the_sample_of_the_same_rank(connection):
    draw = random.Random(3)
    rates = [Decimal(text) for text in ("0", "0.01", "0.07", "0.1", "0.29", "0.3", "0.5", "0.99", "1", "0.3333")]
    for N in (1, 2, 3, 7, 10, 57, 100, 200):
        samples = sorted(draw.choice((draw.random(), 0.25)) for _ in range(N))
        for r in rates:
            theta, seen = connection.execute(
                "SELECT threshold($s::DOUBLE[], $r::DECIMAL(18, 17)), resolvable_with($N, $r::DECIMAL(18, 17))",
                {"s": samples, "r": str(r), "N": N},
            ).fetchone()
            assert theta == threshold(samples, r), (N, r)
            assert seen == resolvable(r, N), (N, r)


def test_without_samples_there_is_no_theta(connection):
    assert connection.execute("SELECT threshold([]::DOUBLE[], 0.5::DECIMAL(18, 17))").fetchone() == (None,)


def test_r_times_n_is_floored_exactly(connection):
    # In binary, 0.29 * 100 is 28.999999999999996 and 0.07 * 100 is 7.000000000000001.
    samples = [float(n) for n in range(100)]
    for r, theta in (("0.29", 70.0), ("0.07", 92.0)):
        found = connection.execute("SELECT threshold($s, $r::DECIMAL(18, 17))", {"s": samples, "r": r}).fetchone()
        assert found == (theta,)


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True),
        ({"lidar": False}, False),
        ({"widths_px": [640, 1242]}, False),
        ({"heights_px": [376, 375]}, False),
        ({"focals_px": [713.0, 700.0]}, True),
        ({"focals_px": [715.0, 700.0]}, False),
        ({"baselines_m": [0.0649]}, True),
        ({"baselines_m": [0.0651]}, False),
        ({"baselines_m": []}, False),
    ],
)
def test_rig_kinds_match_in_sql_as_in_python(connection, changes, same):
    kind = {
        "lidar": True,
        "widths_px": [1242, 1242],
        "heights_px": [375, 375],
        "focals_px": [700.0, 700.0],
        "baselines_m": [0.06],
    }
    struct = (
        "STRUCT(lidar BOOLEAN, widths_px INTEGER[], heights_px INTEGER[], focals_px DOUBLE[], baselines_m DOUBLE[])"
    )
    answer = connection.execute(
        f"SELECT kinds_match($a::{struct}, $b::{struct})", {"a": kind, "b": {**kind, **changes}}
    ).fetchone()
    assert answer == (same,)


@pytest.mark.parametrize(("k", "n"), [(50, 50), (0, 333), (3, 8)])
def test_wilsons_interval_in_sql_is_that_in_python_and_stays_in_0_to_1(connection, k, n):
    sql = "SELECT wilson($k, $n, -1), wilson($k, $n, 1), wilson(0, 0, 1), wilson(NULL, $n, 1), wilson($k, NULL, -1)"
    low, high, *unknown = connection.execute(sql, {"k": k, "n": n}).fetchone()
    assert (low, high) == pytest.approx(wilson(k, n), abs=1e-15)
    assert 0 <= low <= high <= 1
    assert unknown == [None, None, None]
