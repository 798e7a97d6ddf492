"""Which measurements of one recording are judged as one series."""

from types import SimpleNamespace

import pytest

from auditor.pipeline.judge import rigs_in_turn
from tests.making.report_stores import make_rig

RIG, FEWER = make_rig(), make_rig(("velo", "right", "left"))


def beside(**other):
    """Those beside measurement a of a recording that was also measured as b."""
    usual = {"rig_id": "r", "procedure": "sgbm", "withheld": None}
    stored = {"a": SimpleNamespace(**usual), "b": SimpleNamespace(**{**usual, **other})}
    store = SimpleNamespace(
        measurement=stored.__getitem__,
        has_measurement=stored.__contains__,
        rig={"r": RIG, "again": RIG, "fewer": FEWER}.__getitem__,
    )
    recording = SimpleNamespace(sightings=[SimpleNamespace(measurements=["a", "b", "removed"])])
    return rigs_in_turn(store, recording, "a")


def test_a_rig_of_the_same_sensors_goes_on_where_the_other_ends():
    assert beside(rig_id="again") == ("b",)


@pytest.mark.parametrize(
    "other", [{"rig_id": "fewer"}, {"procedure": "psmnet"}, {"withheld": "points fit the images nowhere"}]
)
def test_other_sensors_other_ways_of_measuring_and_what_cannot_be_judged_do_not(other):
    assert beside(**other) == ()
