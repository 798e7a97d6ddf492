"""A scan on a cluster of Ray: what is measured is what a scan here measures, whichever machine is lost."""

import importlib.util
import signal
import subprocess
import sys
import time

import pytest

from auditor.cli import run
from auditor.errors import SettingError
from auditor.model.settings import Engine, MeasureSettings
from auditor.pipeline.library import scan
from auditor.pipeline.many import find_batch, measure_all
from auditor.pipeline.remote.ray_cluster import Cluster
from auditor.store.maintenance.verify import verify
from auditor.store.store import Store
from tests.making import stand_in_ray
from tests.making.object_stores import begin_with, object_store
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive
from tests.pipeline.test_object_stores import content_of

RECORDINGS = 3

needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed")


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """Recordings, and what a scan of this machine measures of them."""
    folder = tmp_path_factory.mktemp("fleet")
    for number in range(RECORDINGS):
        start_ns = START_NS + number * DAY_NS
        write_drive(folder / f"drive{'abcd'[number]}.mcap", 3, positions_m=THREE_CAMERAS, start_ns=start_ns)
    store = tmp_path_factory.mktemp("here") / "audit"
    assert not [one for one in scan(folder, store=store, jobs=1) if one.error]
    return folder, content_of(store)


def test_a_scan_on_a_cluster_leaves_what_a_scan_here_leaves(here, tmp_path, monkeypatch):
    groups = stand_in_ray.stand_in(monkeypatch, cores=1)
    monkeypatch.chdir(here[0])  # paths are of the folder that the command runs in
    assert run(["scan", ".", "--store", str(tmp_path / "audit"), "--engine", "ray", "--address", "auto"]) == 0
    assert [len(one) for one in groups] == [1] * RECORDINGS
    assert content_of(tmp_path / "audit") == here[1]
    assert verify(Store.open(tmp_path / "audit")).problems == ()


def test_what_a_lost_machine_measured_nothing_of_is_told_and_measured_the_next_time(here, tmp_path, monkeypatch):
    stand_in_ray.stand_in(monkeypatch, lost=[2], cores=1)
    found = list(scan(here[0], store=tmp_path / "audit", engine="ray"))
    [lost] = [one for one in found if one.error is not None]
    assert "drivec.mcap" in str(lost.error)
    assert "lost" in str(lost.error)
    groups = stand_in_ray.stand_in(monkeypatch, cores=1)
    assert not [one for one in scan(here[0], store=tmp_path / "audit", engine="ray") if one.error]
    assert [len(one) for one in groups] == [1], "what is known is not handed over again"


def test_a_store_on_an_object_store_has_what_machines_put_there(here, tmp_path, monkeypatch):
    stand_in_ray.stand_in(monkeypatch, cores=1)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with object_store() as server:
        begin_with(monkeypatch, server)
        found = list(scan(here[0], store="s3://fleet/audit", engine="ray"))
        assert [len(one.judged) for one in found] == [1] * RECORDINGS
        again = list(scan(here[0], store="s3://fleet/audit"))
        assert [one.measured.fresh for one in again] == [False] * RECORDINGS


def test_small_recordings_are_one_task_while_every_core_has_some(monkeypatch):
    stand_in_ray.stand_in(monkeypatch, cores=2)
    cluster = Cluster(sys.modules["ray"])
    assert [len(one) for one in cluster.groups(range(80), lambda _: 2**20)] == [10] * 8
    assert [len(one) for one in cluster.groups(range(80), lambda _: 2**27)] == [2] * 40
    assert [len(one) for one in cluster.groups(range(3), lambda _: 0)] == [1] * 3


def test_what_no_machine_can_take_is_refused(here, tmp_path, monkeypatch):
    stand_in_ray.stand_in(monkeypatch, memory=2e9)
    with pytest.raises(SettingError, match="no machine of the cluster has 4096 MB"):
        list(scan(here[0], store=tmp_path / "audit", engine="ray"))


@pytest.mark.parametrize(
    ("options", "said"), [({"engine": "ray"}, r"auditor\[ray\]"), ({"address": "auto"}, "add --engine ray")]
)
def test_an_engine_that_is_not_there_is_told(here, tmp_path, monkeypatch, options, said):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SettingError, match=said):
        list(scan(here[0], store=tmp_path / "audit", **options))


@pytest.fixture
def cluster():
    """Two machines of one core each."""
    from ray.cluster_utils import Cluster as Machines  # noqa: PLC0415 - not everybody has it

    size = {"num_cpus": 1, "memory": 6 * 10**9, "object_store_memory": 80 * 2**20}
    machines = Machines(initialize_head=True, head_node_args=size)
    machines.add_node(**size)
    yield machines
    machines.shutdown()


@needs_ray
@pytest.mark.filterwarnings("default")
def test_a_machine_that_is_lost_loses_no_recording(here, tmp_path, cluster):
    settings = MeasureSettings(engine=Engine.RAY, address=cluster.address)
    outcomes = []
    for outcome in measure_all(find_batch([here[0]], tmp_path / "audit", settings), lambda *_: None):
        if not outcomes:
            cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)
        outcomes.append(outcome)
    assert [one.error for one in outcomes] == [None] * RECORDINGS
    assert not [one for one in scan(here[0], store=tmp_path / "audit") if one.error]
    assert content_of(tmp_path / "audit") == here[1]


@needs_ray
@pytest.mark.filterwarnings("default")
def test_a_command_that_is_killed_goes_on_where_it_was(here, tmp_path, cluster):
    words = ["scan", str(here[0]), "--store", str(tmp_path / "audit"), "--engine", "ray", "--address", cluster.address]
    process = subprocess.Popen([sys.executable, "-m", "auditor", *words], stderr=subprocess.DEVNULL)
    while process.poll() is None and not list((tmp_path / "audit").glob("measurements/*.parquet")):
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = len(Store.open(tmp_path / "audit").ids("measurements"))
    assert before > 0
    found = list(scan(here[0], store=tmp_path / "audit", engine="ray", address=cluster.address))
    assert [one.error for one in found] == [None] * RECORDINGS
    assert content_of(tmp_path / "audit") == here[1]
