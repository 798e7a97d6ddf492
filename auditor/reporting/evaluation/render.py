"""The evaluation report: one self-contained HTML page, made from the store alone."""

from pathlib import Path

from auditor.reporting.evaluation.loading import load_evaluation
from auditor.reporting.evaluation.page import EvaluationPage, Rate
from auditor.reporting.evaluation.plots import BOTTOM_PX, HEIGHT_PX, LEFT_PX, RIGHT_PX, TOP_PX, WIDTH_PX
from auditor.reporting.templates import fill
from auditor.store.store import Store

NO_BREAK_SPACE = "\u00a0"


def render_evaluation_report(store: Store, *, out: Path) -> Path:
    """Write the page of everything that was evaluated into a store; answer `out`.

    Raises StoreError where nothing was evaluated or the page cannot be written.
    """
    return store.write_page(out, render_evaluation(load_evaluation(store)))


def render_evaluation(page: EvaluationPage) -> str:
    """The page as HTML. All of its text is escaped; it refers to nothing outside itself."""
    frame = {"left": LEFT_PX, "right": RIGHT_PX, "top": TOP_PX, "bottom": BOTTOM_PX, "width": WIDTH_PX}
    return fill(
        "evaluation.html",
        {"page": page, "height": HEIGHT_PX, **frame},
        filters={"percent": percent, "thousands": "{:,}".format},
        tests={"rate": lambda cell: isinstance(cell, Rate)},
    )


def percent(share: float) -> str:
    """Per cent to one decimal, never rounded to 0 or 100 % where it is neither."""
    if 0 < share < 0.0005 or 0.9995 <= share < 1:
        return f"{share * 100:.2f}{NO_BREAK_SPACE}%"
    return f"{share * 100:.1f}{NO_BREAK_SPACE}%"
