"""Text that others wrote can do nothing but be read."""

import sys
import unicodedata

import pytest

from auditor.model.text import csv_cell, one_line, storable


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("drive 7, größer, 車, 🚗.mcap", "drive 7, größer, 車, 🚗.mcap"),
        ("a\nauditor: all is well", r"a\nauditor: all is well"),
        ("\r\t\0\x1b[2J\x7f", r"\r\t\x00\x1b[2J\x7f"),
        ("\x85\x9b31m", r"\x85\x9b31m"),
        ("\u202egnp.exe\u2066\u200f\ufeff", r"\u202egnp.exe\u2066\u200f\ufeff"),
        ("a\u2028b\u2029c", r"a\u2028b\u2029c"),
        ("\udcff.mcap \ud800 \U000e0041 \ue000", r"\xff.mcap \ud800 \U000e0041 \ue000"),
    ],
)
def test_what_is_more_than_shown_is_written_out(text, line):
    assert one_line(text) == line
    assert one_line(line) == line


def test_no_character_of_unicode_can_control_a_screen():
    everything = one_line("".join(map(chr, range(sys.maxunicode + 1))))
    assert {unicodedata.category(c) for c in everything} & {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"} == set()
    everything.encode()


def test_what_can_be_stored_is_the_same_text_but_for_bytes_that_are_none():
    assert storable("a\n\x1b\u202e") == "a\n\x1b\u202e"
    assert storable("\udcff\udce4.mcap \ud800") == r"\xff\xe4.mcap \ud800"


@pytest.mark.parametrize(
    "formula", ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", " =1", "\uff1d1", "-", "--01", "="]
)
def test_a_formula_is_text_for_a_spreadsheet(formula):
    assert csv_cell(formula) == f"'{formula}"


@pytest.mark.parametrize("text", ["-5", "+1.5", "-1e-3", "12", "a=b", "S_2", "", "'=1"])
def test_numbers_and_other_text_stay_what_they_are(text):
    assert csv_cell(text) == text


def test_a_cell_has_one_line_and_no_tab_before_its_formula():
    assert csv_cell("\t=1") == r"\t=1"
    assert csv_cell("\r\n=1") == r"\r\n=1"
    assert csv_cell("\x1b[2J") == r"\x1b[2J"
