from pathlib import Path

import pytest

from auditor.errors import SettingError
from auditor.recordings import Origin, read_path


@pytest.mark.parametrize(
    ("path", "pattern", "expected"),
    [
        (
            "/fleet/V7/2026-03-01/night.mcap",
            "{vehicle}/{date}/{drive}.mcap",
            {"vehicle": "V7", "date": "2026-03-01", "drive": "night"},
        ),
        ("fleet/V7_2026-03-01_0003.bag", "{vehicle}_{date}_*.bag", {"vehicle": "V7", "date": "2026-03-01"}),
        ("V7/a.mcap", "{vehicle}/*", {"vehicle": "V7"}),
        ("V7/heavy rain/a.mcap", "{vehicle}/{weather}/*", {"vehicle": "V7", "weather": "heavy rain"}),
        ("/fleet/V7/a.mcap", "{vehicle}/{date}/*.bag", {}),
        ("/fleet/V(7)+/a.b.mcap", "V({vehicle})+/a.b.mcap", {"vehicle": "7"}),
        ("/fleet/V(7)+/aXb.mcap", "V({vehicle})+/a.b.mcap", {}),
    ],
)
def test_the_end_of_a_path_gives_the_words_of_the_pattern(path: str, pattern: str, expected: dict[str, str]) -> None:
    assert read_path(Path(path), pattern) == expected


@pytest.mark.parametrize("pattern", ["", "*/*.mcap", "{car}/*", "{}/*", "{vehicle}/{vehicle}"])
def test_a_pattern_without_a_known_word_is_refused(pattern: str) -> None:
    with pytest.raises(SettingError, match="vehicle"):
        read_path(Path("a/b"), pattern)


def test_what_was_given_goes_before_what_the_metadata_say() -> None:
    declared = Origin.of_metadata({"vehicle": "V7", "weather": "snow", "date": "2026-01-31"})
    found = Origin(weather="rain").over(declared)
    assert (found.vehicle, found.weather, found.date) == ("V7", "rain", declared.date)
    assert declared.weather == "snow"
