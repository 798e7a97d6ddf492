"""One module a verb, imported when that verb runs."""
