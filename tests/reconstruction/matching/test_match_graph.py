"""The match graph: counts by kinds, groups, and files that any reader takes."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from match_scenes import cameras, features, project, world

from reconstruction.matching import MatchGraph, MatchSettings, PairResult, match_pair
from reconstruction.matching import pictures as drawing


@pytest.fixture(scope="module")
def graph():
    """a-b matched, b-c planar, a-c failed, d alone."""
    cams = cameras()
    scene, flat = world(80), world(80, "plane")
    matched = match_pair(*features(project(cams[0], scene), project(cams[1], scene), wrong=10), MatchSettings(), ("a", "b"), cams)
    planar = match_pair(*features(project(cams[0], flat), project(cams[1], flat)), MatchSettings(), ("b", "c"))
    failed = [PairResult(x, y, "failed: no matches", "none", (5, 6)) for x, y in (("a", "c"), ("a", "d"))]
    return MatchGraph({"a": "mural", "b": "mural", "c": "textile", "d": "figurine"}, (matched, planar, *failed))


def test_table_by_kinds(graph):
    rows = {row["kinds"]: row for row in graph.by_kinds()}
    assert set(rows) == {"mural - mural", "mural - textile", "mural - figurine"}  # pairs that were not tried have no row
    assert (rows["mural - mural"]["matched"], rows["mural - mural"]["share_matched"]) == (1, 1.0)
    assert rows["mural - mural"]["inliers"] == graph.results[0].inliers > 50
    assert rows["mural - mural"]["median_sampson_cameras_px"] == graph.results[0].sampson_cameras < 1
    assert rows["mural - figurine"]["inliers"] == 0 and np.isnan(rows["mural - figurine"]["median_sampson_px"])
    mixed = rows["mural - textile"]
    assert (mixed["pairs"], mixed["matched"], mixed["degenerate"], mixed["failed"]) == (2, 0, 1, 1)
    assert 0.4 < mixed["median_rate"] < 0.55  # a pair without matches counts as 0


def test_groups_with_and_without_planar_pairs(graph):
    assert graph.components() == [["a", "b"], ["c"], ["d"]]
    assert graph.components(degenerate=True) == [["a", "b", "c"], ["d"]]
    assert graph.statuses() == {"failed: no matches": 2, "degenerate: planar": 1, "matched": 1}


def test_networkx_graph_carries_the_numbers(graph):
    found = graph.graph()
    assert found.nodes["c"]["kind"] == "textile" and found.edges["a", "b"]["inliers"] == graph.results[0].inliers
    assert found.number_of_edges() == 4


def test_files_read_back(graph, tmp_path):
    assert {path.name for path in graph.write(tmp_path)} == {"pairs.csv", "kinds.csv", "matches.json"}
    with (tmp_path / "pairs.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows] == [result.status for result in graph.results]
    assert float(rows[0]["median_sampson_px"]) == pytest.approx(graph.results[0].sampson, rel=1e-4)
    assert rows[1]["median_sampson_cameras_px"] == "" and rows[2]["rate"] == ""

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    read = json.loads((tmp_path / "matches.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert np.allclose(read["pairs"][0]["fundamental"], graph.results[0].fundamental)
    assert read["pairs"][2]["fundamental"] is None and read["components"] == graph.components()


def test_pictures_are_drawn(graph, tmp_path):
    from PIL import Image

    small = np.full((48, 64, 3), 200, np.uint8)
    paths = [drawing.match_lines(tmp_path / f"{i}.png", result, small, small, (0.1, 0.1)) for i, result in enumerate(graph.results)]
    paths += [drawing.graph_drawing(tmp_path / "graph.png", graph, {"a": small}), drawing.matrix(tmp_path / "matrix.png", graph)]
    paths.append(drawing.matrix(tmp_path / "empty.png", MatchGraph({"a": "mural"}, ())))
    for path in paths:
        pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
        assert pixels.shape[0] > 200 and len(np.unique(pixels @ [65536, 256, 1])) > 20
    lines, none = (np.asarray(Image.open(tmp_path / name).convert("RGB")).astype(int) for name in ("0.png", "2.png"))
    assert drawing.is_drawn(tmp_path / "0.png", "") and not drawing.is_drawn(tmp_path / "0.png", "other")
    assert not drawing.is_drawn(tmp_path / "none.png", "")
    green = [((p[..., 1] > p[..., 0] + 60) & (p[..., 1] > p[..., 2] + 60)).sum() for p in (lines, none)]
    assert green[0] > 500 and green[1] == 0
