"""Names and prose use the words of docs/glossary.md: no name of the old design, and no word of a court room.

The lists are data. A name or phrase that has a new word goes into them, and every room is searched.
"""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

ROOMS_TO_COME: tuple[str, ...] = ()
"""Files and folders that are not searched yet."""

HISTORY = (
    "CHANGELOG.md",
    "docs/decisions.md",
    "docs/glossary.md",
    "tests/benchmarks/golden_rows.py",
)
"""What tells of old words on purpose."""

HERE = "tests/test_words.py"

OLD_NAMES = frozenset(
    [
        "Adjudication",
        "Bench",
        "Dice",
        "Element",
        "Fitting",
        "Heard",
        "Looked",
        "Reach",
        "Specks",
        "Testimony",
        "WayBack",
        "Witness",
        "AttackSetCosts",
        "PairCheck",
        "Yardstick",
        "accusable",
        "accuse",
        "accusing",
        "adjudicate",
        "adjudications",
        "askew",
        "attack_set_costs",
        "bringing_back",
        "brightness_difference",
        "candidate_cameras",
        "candidate_score",
        "compare_light",
        "contradicted",
        "emptiness",
        "explained_by",
        "foretell",
        "foretelling",
        "heard",
        "hear",
        "hold_out",
        "in_step",
        "judge_heard",
        "late_i",
        "late_k",
        "likeness_at",
        "likenesses",
        "local_ratio",
        "local_ratios",
        "LOCAL_RATIO",
        "merely_hidden",
        "misfits",
        "pair_check",
        "pair_checks",
        "pair_checks_of",
        "raisable",
        "rig_pair_checks",
        "scattered",
        "sights",
        "specks",
        "specks_beyond",
        "specks_near",
        "suspicion",
        "suspicions",
        "symptoms",
        "symptom_rows",
        "testify",
        "testimony",
        "too_near",
        "turned_only",
        "unlike",
        "unlike_px",
        "unlikeness",
        "unturned_only",
        "windowed_ratio",
        "windowed_ratios",
        "witness",
        "witnesses",
        "yardstick",
        "yardsticks",
    ]
)
"""Identifiers, and names of columns, that have a new one."""

OLD_MODULES = frozenset(
    [
        "accusing",
        "ahead",
        "bringing_back",
        "contradiction",
        "damaged_images",
        "damaged_points",
        "damaged_scenes",
        "elements",
        "explaining",
        "false_alarms",
        "fingerprints",
        "fitting",
        "foretelling",
        "joint",
        "joining",
        "likeness",
        "local_ratio",
        "measuring",
        "one_view",
        "raisable",
        "rectifying",
        "salvaging",
        "specks",
        "surveying",
        "symptoms",
        "teaching",
        "testimony",
        "watching",
        "witnesses",
    ]
)
"""File names of modules that have a new one."""

OLD_PHRASES = (
    r"witness(es)?\b",
    r"testimon",
    r"testif",
    r"\baccus",
    r"\bconvict",
    r"\binnocent",
    r"\b(could|may) deny\b",
    r"\bden(y|ies|ied) the lidar\b",
    r"\bstands? against\b",
    r"\bheld[ -]out\b",
    r"\bhalf seconds? around\b",
    r"\blocal ratios?\b",
    r"\byardsticks?\b",
    r"\bheard\b",
    r"\badjudicat",
    r"\bbrought back\b",
    r"\bunlikeness\b",
    r"\bsymptoms?\b",
    r"\bis no number\b",
    r"\bmerely hidden\b",
    r"\bpair checks?\b",
    r"\bwindowed ratios?\b",
    r"\bbrightness differences?\b",
    r"\battack set costs?\b",
)
"""Regular expressions of prose in the old sense, found in any case."""


def files(pattern: str, *folders: str) -> Iterator[Path]:
    """The files of some folders, or of the root, that are searched."""
    for folder in folders:
        for path in sorted((ROOT / folder).glob(pattern)):
            place = path.relative_to(ROOT).as_posix()
            exempt = (*ROOMS_TO_COME, *HISTORY, HERE)
            if not any(place == one or place.startswith(f"{one}/") for one in exempt):
                yield path


def by_room(offenders: dict[Path, list[str]]) -> dict[str, list[str]]:
    """The offenders of each room, as a failing test prints them."""
    rooms: dict[str, list[str]] = {}
    for path, found in offenders.items():
        place = path.relative_to(ROOT)
        rooms.setdefault("/".join(place.parts[:2]), []).extend(f"{place.as_posix()}: {one}" for one in found)
    return rooms


def offenders(found: Iterator[tuple[Path, str]]) -> dict[str, list[str]]:
    gathered: dict[Path, list[str]] = {}
    for path, one in found:
        gathered.setdefault(path, []).append(one)
    return by_room(gathered)


def names(tree: ast.AST) -> Iterator[str]:
    """Every identifier that a module defines or uses."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name) | ast.keyword(arg=str(name)):
                yield name
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.alias(name=name):
                yield from name.split(".")


def old_names(path: Path) -> Iterator[str]:
    text = path.read_text(encoding="utf-8")
    if OLD_NAMES.isdisjoint(word.strip("_") for word in set(re.findall(r"\w+", text))):
        return  # a module is parsed only where the word stands anywhere in it
    found = {part for name in names(ast.parse(text)) for part in (name, name.strip("_"))}
    yield from sorted(found & OLD_NAMES)


def in_each(phrase: str) -> str:
    """The longest word that every hit of a phrase has in it: what is optional or has a choice is left out."""
    return max(re.sub(r"\([^)]*\)\??|\\b|\w\?|\[[^]]*\]", " ", phrase).split(), key=len)


WORDS_OF_PHRASES = {phrase: in_each(phrase) for phrase in OLD_PHRASES}


def old_phrases(text: str) -> Iterator[str]:
    lower = text.lower()
    for phrase, word in WORDS_OF_PHRASES.items():
        if word not in lower:
            continue
        for hit in re.finditer(phrase, text, re.IGNORECASE):
            line = text.count("\n", 0, hit.start()) + 1
            yield f"line {line}: {hit.group()}"


def test_a_phrase_is_found_in_any_case_and_with_each_of_its_endings() -> None:
    text = "Witnesses stand\nAgainst it: they may deny it, and HELD-OUT frames denied the LiDAR its pair check."
    hits = [hit for phrase in OLD_PHRASES for hit in re.findall(phrase, text, re.IGNORECASE)]
    assert len(list(old_phrases(text))) == len(hits) == 5
    assert WORDS_OF_PHRASES[r"\byardsticks?\b"] == "yardstick"
    assert WORDS_OF_PHRASES[r"\b(could|may) deny\b"] == "deny"


def test_no_identifier_of_python_is_an_old_one() -> None:
    found = ((path, name) for path in files("**/*.py", "auditor", "tests") for name in old_names(path))
    assert offenders(found) == {}


def test_no_module_has_an_old_name() -> None:
    found = ((path, path.name) for path in files("**/*.py", "auditor", "tests") if path.stem in OLD_MODULES)
    assert offenders(found) == {}


def test_no_query_names_an_old_column() -> None:
    sql = ((path, re.sub(r"--.*|'[^']*'", "", path.read_text())) for path in files("**/*.sql", "queries"))
    words = ((path, word) for path, text in sql for word in re.findall(r"\w+", text))
    assert offenders((path, word) for path, word in words if word in OLD_NAMES) == {}


def test_no_table_has_an_old_column() -> None:
    texts = ((path, tomllib.loads(path.read_text(encoding="utf-8"))) for path in files("*.toml", "schemas"))
    words = ((path, word) for path, schema in texts for word in re.findall(r"\w+", repr(schema.get("columns", schema))))
    assert offenders((path, word) for path, word in words if word in OLD_NAMES) == {}


def test_no_prose_uses_an_old_word() -> None:
    paths = (*files("*.md", ".", "docs"), *files("**/*.py", "auditor", "tests"), *files("**/*.toml", "reports"))
    assert offenders((path, hit) for path in paths for hit in old_phrases(path.read_text(encoding="utf-8"))) == {}
