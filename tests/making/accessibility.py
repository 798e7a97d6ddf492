"""What a page needs so that everybody can use it, as far as its text and its colours show it."""

import re
from html.parser import HTMLParser

_TEXT_PAIRS = (
    *((text, ground) for text in ("ink", "muted", "link") for ground in ("paper", "faint")),
    ("finding", "finding-faint"),
    ("finding", "paper"),
    ("open", "open-faint"),
    ("clean", "clean-faint"),
    ("line", "line-faint"),
    *(("ink", f"{name}-faint") for name in ("finding", "open", "clean")),
)
"""Names of colours of text, and of the grounds that they stand on."""


class _Reader(HTMLParser):
    """What is wrong with a page, one sentence each."""

    def __init__(self) -> None:
        super().__init__()
        self.wrong: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.depth: list[str] = []
        self.headings: list[int] = []
        self.text_of: dict[str, str] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.seen.append((tag, attributes))
        self.depth.append(tag)
        if re.fullmatch(r"h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag == "img" and not attributes.get("alt"):
            self.wrong.append("a picture has no text")
        if tag == "th" and attributes.get("scope") not in {"col", "row", "colgroup"}:
            self.wrong.append("a head of a table has no scope")
        if attributes.get("tabindex") == "0" and not (attributes.get("aria-label") and attributes.get("role")):
            self.wrong.append("what takes the focus has no name")
        if tag == "table" and not any(one.get("tabindex") == "0" for _, one in self.seen[-2:-1]):
            self.wrong.append("a table cannot be scrolled by keyboard")
        if tag == "svg" and not (
            (attributes.get("role") == "img" and attributes.get("aria-label")) or attributes.get("aria-hidden")
        ):
            self.wrong.append("a drawing has neither a text nor is it hidden")

    def handle_data(self, data: str) -> None:
        for tag in ("title", "h1"):
            if tag in self.depth[-1:]:
                self.text_of[tag] = self.text_of.get(tag, "") + data

    def handle_endtag(self, tag: str) -> None:
        while self.depth and self.depth.pop() != tag:
            pass


def complaints(text: str) -> list[str]:
    """What keeps somebody from using a page: language, title, headings, landmarks, texts, heads of tables, names."""
    page = _Reader()
    page.feed(text)
    tags = [tag for tag, _ in page.seen]
    wrong = list(page.wrong)
    if ("html", {"lang": "en"}) not in page.seen:
        wrong.append("it has no language")
    if not page.text_of.get("title", "").strip():
        wrong.append("it has no title")
    if page.headings[:1] != [1] or page.headings.count(1) != 1:
        wrong.append("it has not one heading of the first level, which comes first")
    if any(after > before + 1 for before, after in zip(page.headings, page.headings[1:], strict=False)):
        wrong.append("a level of headings is left out")
    if (tags.count("main"), tags.count("footer")) != (1, 1):
        wrong.append("it has not one main part and one foot")
    ids = [attributes["id"] for _, attributes in page.seen if "id" in attributes]
    if len(ids) != len(set(ids)):
        wrong.append("two elements have one id")
    return wrong


def contrasts(css: str, *, dark: bool) -> dict[tuple[str, str], float]:
    """The contrast of each pair of colours of text and ground, as WCAG 2 defines it: 4.5 is the least for text."""
    light, *darks = re.findall(r":root\s*{(.*?)}", css, re.DOTALL)
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", light))
    if dark:
        colours.update(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", darks[0]))
    found = {pair: _contrast(colours[pair[0]], colours[pair[1]]) for pair in _TEXT_PAIRS}
    return {**found, ("#ffffff", "finding-solid"): _contrast("#ffffff", colours["finding-solid"])}


def _contrast(one: str, other: str) -> float:
    darker, lighter = sorted((_luminance(one), _luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    shares = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
