"""The page in a real browser, where there is one."""

import pytest
from report_trial import content

from mfar_fem.errors import MissingDependencyError
from reconstruction.report.browser import chromium, look
from reconstruction.report.write import write_report

pytest.importorskip("playwright")


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    try:
        chromium()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    return look(write_report(content(), tmp_path_factory.mktemp("report") / "report.html"))


def test_it_loads_without_errors_or_requests(seen):
    assert seen.errors == () and seen.requests == () and seen.live


def test_the_model_is_drawn_turns_and_comes_back(seen):
    assert seen.drawn > 0.03
    assert seen.dragged > 0.2 and seen.keyed > 0.02 and seen.touched > 0.1 and seen.switched > 0.2
    assert seen.restored == 0


def test_it_fits_a_telephone_and_has_words_for_pictures(seen):
    assert set(seen.overflow) == {1280, 390} and all(v == 0 for v in seen.overflow.values())
    assert seen.without_alt == 0 and seen.headings[0] == 1


def test_wishes_of_the_reader_are_kept(seen):
    assert not seen.moves_by_itself and seen.fallback
