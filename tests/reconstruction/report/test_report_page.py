"""The page: all in one file, nothing taken as markup, and refused where it would be too large or wrong."""

import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from report_trial import content, photograph, tube

from mfar_fem.errors import DataFileError, InputError
from reconstruction.report.content import Cost, Evidence, Model, Picture, Scalar, Section, Table
from reconstruction.report.pictures import data_uri
from reconstruction.report.write import HERE, cell, grouped, numeric, render, write_report


class Reader(HTMLParser):
    """Collects tags with their attributes and complains of what is not closed."""

    VOID = ("meta", "link", "img", "br", "input", "source")

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.text += data


@pytest.fixture(scope="module")
def rendered():
    return render(content())


def test_one_file_without_addresses(tmp_path):
    path = write_report(content(), tmp_path / "new" / "report.html")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    text = path.read_text(encoding="utf-8")
    page = Reader(text)
    assert not page.open
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset"):
            assert attributes.get(name, "#").startswith(("#", "data:")), (tag, attributes)
    assert "default-src 'none'" in text and not re.search(r"https?://", re.sub(r"data:[^\"']*", "", text))
    assert path.read_bytes() == write_report(content(), tmp_path / "again.html").read_bytes()


def test_structure_for_readers_who_cannot_see_it(rendered):
    page = Reader(rendered)
    assert all(a.get("alt") for t, a in page.tags if t == "img")
    levels = [int(t[1]) for t, _ in page.tags if re.fullmatch(r"h[1-6]", t)]
    assert levels[0] == 1 and levels.count(1) == 1 and max(np.diff(levels)) <= 1
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(set(ids)) == len(ids)
    named = [a[n] for _, a in page.tags for n in ("aria-labelledby", "aria-describedby") if n in a]
    named += [a["href"][1:] for t, a in page.tags if t == "a"]
    assert named and set(named) <= set(ids)
    assert ("html", {"lang": "en"}) in page.tags
    heads = [a for t, a in page.tags if t == "th"]
    assert all(a.get("scope") in ("col", "row") for a in heads)


@pytest.mark.parametrize("scheme", [0, 1])
def test_contrast(scheme):
    """WCAG 2.2, 1.4.3: 4.5 for text; 1.4.11: 3 for what carries meaning."""
    style = (HERE / "style.css").read_text()
    blocks = re.findall(r":root \{(.*?)\}", style, re.S)[:2]
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", blocks[scheme]))

    def light(name):
        c = np.array([int(colours[name][i : i + 2], 16) / 255 for i in (1, 3, 5)])
        return float(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722))

    def ratio(a, b):
        high, low = sorted((light(a), light(b)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    words = "text page, quiet page, link page, text soft, quiet soft, text warn, page focus"
    for text, ground in (pair.split() for pair in words.split(", ")):
        assert ratio(text, ground) >= 4.5, (text, ground)
    marks = "focus page, evidence page, prior page, stroke cloth, edge cloth, warn-edge page"
    for mark, ground in (pair.split() for pair in marks.split(", ")):
        assert ratio(mark, ground) >= 3, (mark, ground)


def test_nothing_given_is_taken_as_markup():
    bad = "<script>alert(1)</script>"
    mesh = tube()
    text = render(content(title=bad, garment=bad, summary=bad, facts={bad: bad}, notes=[bad], provenance={bad: bad},
                          costs=[Cost(bad, 1.0)], evidence=[Evidence(bad, 1.0, "prior", bad)],
                          models=[Model(bad, mesh, [Scalar(bad, mesh.vertices[:, 2], bad)], note=bad, lines_label=bad)],
                          sections=[Section(bad, bad, [Picture(photograph(), f'">{bad}', bad)], [Table([bad], [[bad]], bad)],
                                            [bad])]))  # fmt: skip
    assert bad not in text
    page = Reader(text)
    assert page.text.count(bad) >= 15 and sum(t == "script" for t, _ in page.tags) == 2


def test_costs_evidence_and_cells(rendered):
    page = Reader(rendered)
    seen = re.sub(r"\s+", " ", page.text)
    assert "all, kept results included" in seen and "31.3" in seen and "no time for one garment" in seen
    assert "5 % not accounted for" in seen
    rows = grouped([Evidence("a", 0.25, "prior", "x"), Evidence("b", 1, "evidence"), Evidence("a", 0.5, "evidence", "y")])
    assert [(r["what"], r["evidence"], r["prior"], r["unknown"], r["detail"]) for r in rows] == [
        ("a", 0.5, 0.25, 0.25, ["x", "y"]), ("b", 1.0, 0.0, 0.0, []),
    ]  # fmt: skip
    assert [cell(v) for v in (None, float("nan"), True, 3, 3.0, 0.123456, np.float32(2.5), 1234567.0, "x")] == [
        "–", "–", "yes", "3", "3", "0.1235", "2.5", "1.235e+06", "x",
    ]  # fmt: skip
    assert numeric(Table(["a", "b", "c", "d"], [["x", 1, None, True], ["y", None, None, 2]])) == {1}


def test_a_page_without_models_has_no_script():
    page = Reader(render(content(models=[], backdrop=None)))
    assert not [t for t, _ in page.tags if t in ("script", "canvas")]


@pytest.mark.parametrize(("make", "said"), [
    (lambda: Picture(b"", " "), "alternative text"), (lambda: Table([], []), "no columns"),
    (lambda: Table(["a", "b"], [["x"]], "T"), "row 0 of the table 'T' has 1 values for 2"), (lambda: Section(" "), "no title"),
    (lambda: Evidence("hem", 0.5, "hope"), "one of evidence, prior"), (lambda: Evidence("hem", 1.5, "prior"), "between 0 and 1"),
    (lambda: content(evidence=[Evidence("a", 0.8, "prior"), Evidence("a", 0.3, "evidence")]), "more than one"),
    (lambda: content(models=[Model("a", tube()), Model("a", tube())]), "different names"), (lambda: content(title=""), "no title"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_too_large_a_page_is_refused_and_names_its_parts(tmp_path):
    with pytest.raises(InputError, match=r"0\.1 are allowed; largest parts: model 'Final' 0\.1 MB, model 'Start'"):
        write_report(content(sections=[]), tmp_path / "report.html", max_MB=0.1)
    assert not list(tmp_path.iterdir())


def test_pictures_are_known_by_content_and_reduced(tmp_path):
    import base64

    from PIL import Image

    assert data_uri(photograph(form="PNG")).startswith("data:image/png;")
    uri = data_uri(photograph((300, 120)), longest=100)
    assert uri.startswith("data:image/jpeg;")
    assert Image.open(io.BytesIO(base64.b64decode(uri.split(",")[1]))).size == (100, 40)
    with pytest.raises(InputError, match="no PNG, JPEG or SVG"):
        data_uri(b"GIF89a")
    with pytest.raises(InputError, match="cannot be decoded"):
        data_uri(photograph()[:60])
    with pytest.raises(DataFileError, match="absent"):
        data_uri(tmp_path / "absent.png")
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(DataFileError, match=r"text\.png"):
        data_uri(tmp_path / "text.png")
