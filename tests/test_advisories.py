"""No package that is installed, and none that a lower bound admits, has a hole that is known and reached."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parent.parent
ADVISORIES = tomllib.loads((ROOT / "tests" / "advisories.toml").read_text())["advisory"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def requirements() -> list[Requirement]:
    """What the project and its extras ask for, itself apart."""
    lists = (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    return [needed for text in lists for line in text if (needed := Requirement(line)).name != "auditor"]


def lower_bound(needed: Requirement) -> Version:
    """The earliest version that a requirement admits."""
    [bound] = [Version(one.version) for one in needed.specifier if one.operator == ">="]
    return bound


BOUNDS = {canonicalize_name(needed.name): lower_bound(needed) for needed in requirements()}


def described(advisory: dict[str, str]) -> str:
    return f"{advisory['package']} {advisory['id']}"


def is_installed_before(advisory: dict[str, str]) -> bool:
    try:
        return Version(version(advisory["package"])) < Version(advisory["fixed"])
    except PackageNotFoundError:
        return False


def test_what_is_installed_has_no_known_hole() -> None:
    assert [described(advisory) for advisory in ADVISORIES if is_installed_before(advisory)] == []


def test_no_lower_bound_admits_a_known_hole() -> None:
    """A hole that is admitted says why it is not reached, and no other."""
    admitted = {
        described(advisory): BOUNDS[canonicalize_name(advisory["package"])] < Version(advisory["fixed"])
        for advisory in ADVISORIES
    }
    assert admitted == {described(advisory): "not_reached" in advisory for advisory in ADVISORIES}


def test_each_advisory_is_complete_and_stands_once() -> None:
    for advisory in ADVISORIES:
        assert advisory.keys() - {"not_reached"} == {"package", "id", "fixed", "source"}
        assert re.fullmatch(r"CVE-\d{4}-\d+|GHSA(-[0-9a-z]{4}){3}", advisory["id"])
        assert advisory["source"].startswith("https://")
    assert len({described(advisory) for advisory in ADVISORIES}) == len(ADVISORIES)


def test_the_lists_agree_where_a_package_is_asked_for_twice() -> None:
    bounds = [(needed.name, str(needed.specifier)) for needed in requirements()]
    assert len({name for name, _ in bounds}) == len(set(bounds))
