"""Which pictures are kept in a store, or shown on a page."""

from enum import StrEnum


class Pictures(StrEnum):
    """How many pictures: people and number plates stand in them."""

    NONE = "none"
    INCIDENTS = "incidents"
    ALL = "all"
