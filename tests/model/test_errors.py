import pickle

from auditor.errors import AuditorError, RecordingError


def test_an_error_reads_as_one_line_with_what_where_and_a_remedy() -> None:
    error = RecordingError("the file is empty", where="night/a.mcap", remedy="record it again")
    assert str(error) == "night/a.mcap: the file is empty; record it again"
    assert str(AuditorError("nothing to do")) == "nothing to do"


def test_an_error_crosses_from_one_process_to_another_whole() -> None:
    error = RecordingError("cut", where="a.mcap", remedy="nothing")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again)) == (RecordingError, str(error))


def test_an_error_without_a_place_can_be_given_one_and_one_with_a_place_keeps_it() -> None:
    assert str(RecordingError("cut", remedy="nothing").located("a.mcap")) == "a.mcap: cut; nothing"
    assert str(RecordingError("cut", where="b.mcap").located("a.mcap")) == "b.mcap: cut"
