"""A few iterations of the fuzzer on the forms that native decoders of an extra read."""

from pathlib import Path

import pytest

from tests.benchmarks.fuzzing import Seeds, one


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Seeds:
    made = Seeds(tmp_path_factory.mktemp("seeds"))
    made.add_packets()
    made.add_parts(tmp_path_factory.mktemp("parts"))
    made.keep(("key", "next", "avif file", "npz", "feather", "camchain", "velodyne", "draco bare"))
    return made


def test_damaged_packets_and_files_raise_only_our_own_errors(seeds: Seeds, tmp_path: Path) -> None:
    touched = {one(seed, seeds, tmp_path) for seed in range(600)}
    assert touched == {*seeds.parts, *seeds.payloads}
