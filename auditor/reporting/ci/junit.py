"""An audit as JUnit XML: one test case a recording, which fails where an incident does, or is an error if unaudited."""

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from auditor.model.text import one_line
from auditor.reporting.ci.audit import Audit, sentence
from auditor.reporting.ci.policy import Decided


def junit(audit: Audit) -> str:
    """An audit as the text of a JUnit XML file."""
    left = {(one.name, one.path): one for one in audit.left}
    suite = ET.Element("testsuite", name="auditor")
    named = {row["recording_id"]: row for row in audit.recordings}
    for recording_id, row in named.items():
        path = audit.paths.get(recording_id, "")
        mine = [
            one for one in audit.decided if any(part["recording_id"] == recording_id for part in one.incident["parts"])
        ]
        reason = left.pop((row["name"], path)).reason if (row["name"], path) in left else ""
        _case(suite, row["name"], row["vehicle"], mine, reason)
    for one in left.values():
        _case(suite, one.name, None, (), one.reason)
    for name, tag in (("tests", "testcase"), ("failures", "testcase/failure"), ("errors", "testcase/error")):
        suite.set(name, str(len(suite.findall(tag))))
    suites = ET.Element("testsuites")
    suites.append(suite)
    ET.indent(suites)
    return ET.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def _case(suite: ET.Element, name: str, vehicle: str | None, decided: Sequence[Decided], reason: str) -> None:
    """Add a recording: all that fails in it is one failure, since readers take one of a case."""
    case = ET.SubElement(suite, "testcase", classname=f"auditor.{_shown(vehicle or 'recording')}", name=_shown(name))
    failing = [one for one in decided if one.fails]
    excused = [one for one in decided if not one.fails]
    if failing:
        kinds = sorted({one.incident["kind"] for one in failing})
        failure = ET.SubElement(case, "failure", type=" ".join(kinds), message=_shown(sentence(failing[0])))
        failure.text = _shown("; ".join([sentence(one) for one in failing] + ([reason] if reason else [])))
    elif reason:
        ET.SubElement(case, "error", type="not audited", message=_shown(reason))
    if excused:
        out = ET.SubElement(case, "system-out")
        out.text = _shown("; ".join(f"{sentence(one)} ({one.excuse})" for one in excused))


def _shown(text: str) -> str:
    """Text without what XML cannot hold."""
    return one_line(text)
