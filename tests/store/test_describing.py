import re

import pytest

from auditor.errors import QueryError
from auditor.store.queries import describe, list_queries, list_views
from auditor.store.sql_files import bind
from tests.store.store_page import PAGE, written_anew


def test_every_column_of_every_view_and_query_has_its_sentence_and_no_other_is_described():
    for file in (*list_queries(), *list_views()):
        description = describe(file.name)
        assert description.text.endswith("."), file.name
        for column in description.columns:
            assert column.sentence.endswith("."), (file.name, column)
            assert column.type, (file.name, column)
        assert set(file.columns) <= {column.name for column in description.columns}, file.name


def test_every_parameter_is_used_and_its_default_is_of_its_type():
    for query in list_queries():
        names = {parameter.name for parameter in query.parameters}
        assert set(re.findall(r"\$(\w+)", query.sql)) == names, query.name
        required = {parameter.name: "0" for parameter in query.parameters if parameter.required}
        assert bind(query, required).keys() == names, query.name


def test_what_is_not_there_is_not_described():
    with pytest.raises(QueryError, match=r"no such query or view; did you mean incidents\?"):
        describe("incident")


def test_the_page_lists_every_table_view_query_and_parameter_in_their_own_words():
    page = PAGE.read_text(encoding="utf-8")
    assert page == written_anew(page), "write it: python -m tests.store.store_page"
    assert re.findall(r"^### (\w+)$", page, re.MULTILINE) == [query.name for query in list_queries()]
