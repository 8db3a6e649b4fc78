"""The match graph of a set of pictures: what fits what, by pair and by kinds of sources."""

from __future__ import annotations

import csv
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.cli.console import jsonable
from reconstruction.libraries import networkx
from reconstruction.matching.pair import PairResult


@dataclass(frozen=True, eq=False)
class MatchGraph:
    """All pairs of a set.

    Attributes
    ----------
    kinds : mapping of str to str
        Kind of source by name of picture, in the order of the set.
    results : tuple of PairResult
        One a pair that was tried.
    """

    kinds: Mapping[str, str]
    results: tuple[PairResult, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the pictures."""
        return tuple(self.kinds)

    def graph(self) -> Any:
        """A networkx graph: a node a picture (``kind``), an edge a pair that was tried (the numbers of :meth:`PairResult.row`)."""
        graph = networkx().Graph()
        for name, kind in self.kinds.items():
            graph.add_node(name, kind=kind)
        for result in self.results:
            graph.add_edge(result.a, result.b, **result.row())
        return graph

    def components(self, degenerate: bool = False) -> list[list[str]]:
        """Groups of pictures that hang together by matched pairs (and, if asked for, degenerate ones), the largest first.

        Planar matches register two pictures by a homography; they do not fix the cameras.
        """
        nx = networkx()
        graph = nx.Graph()
        graph.add_nodes_from(self.kinds)
        graph.add_edges_from((r.a, r.b) for r in self.results if r.matched or (degenerate and r.status.startswith("degenerate")))
        order = {name: i for i, name in enumerate(self.kinds)}
        groups = [sorted(group, key=order.__getitem__) for group in nx.connected_components(graph)]
        return sorted(groups, key=lambda group: (-len(group), order[group[0]]))

    def by_kinds(self) -> list[dict]:
        """For every pair of kinds: pairs tried, matched, degenerate, failed, the median inlier rate of all of them; of the matched
        ones all inliers and the medians of their Sampson distances to the lines estimated and of the given cameras, px (NaN
        without)."""
        present = list(dict.fromkeys(self.kinds.values()))
        rows = []
        for pair in itertools.combinations_with_replacement(present, 2):
            chosen = [r for r in self.results if sorted((self.kinds[r.a], self.kinds[r.b])) == sorted(pair)]
            if not chosen:
                continue
            rates = [r.rate if r.putative else 0.0 for r in chosen]
            matched = [r for r in chosen if r.matched]
            rows.append({
                "kinds": " - ".join(pair), "pairs": len(chosen), "matched": len(matched),
                "degenerate": sum(r.status.startswith("degenerate") for r in chosen),
                "failed": sum(r.status.startswith("failed") for r in chosen),
                "share_matched": len(matched) / len(chosen), "median_rate": float(np.median(rates)),
                "inliers": sum(r.inliers for r in matched), "median_sampson_px": _median([r.sampson for r in matched]),
                "median_sampson_cameras_px": _median([r.sampson_cameras for r in matched]),
            })  # fmt: skip
        return rows

    def statuses(self) -> dict[str, int]:
        """Number of pairs by status."""
        found: dict[str, int] = {}
        for result in self.results:
            found[result.status] = found.get(result.status, 0) + 1
        return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))

    def to_dict(self) -> dict:
        """Everything but the points, in plain types."""
        models = [{"fundamental": r.fundamental, "homography": r.homography} for r in self.results]
        return {
            "pictures": dict(self.kinds), "pairs": [r.row() | m for r, m in zip(self.results, models, strict=True)],
            "by_kinds": self.by_kinds(), "statuses": self.statuses(), "components": self.components(),
            "components_with_degenerate": self.components(degenerate=True),
        }  # fmt: skip

    def write(self, folder: Path) -> list[Path]:
        """Write ``pairs.csv``, ``kinds.csv`` and ``matches.json``; the files are returned."""
        files = [write_csv(folder / "pairs.csv", [r.row() for r in self.results]), write_csv(folder / "kinds.csv", self.by_kinds())]
        path = folder / "matches.json"
        path.write_text(json.dumps(jsonable(self.to_dict()), indent=1), encoding="utf-8")
        return [*files, path]


def _median(values: Sequence[float]) -> float:
    """Median of what is known; NaN without."""
    known = [v for v in values if not math.isnan(v)]
    return float(np.median(known)) if known else math.nan


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write rows with the keys of the first as the header; NaN becomes an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]) if rows else [])
        writer.writeheader()
        for row in rows:
            writer.writerow({key: _cell(value) for key, value in row.items()})
    return path


def _cell(value: Any) -> Any:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return value


def joined(groups: list[list[str]]) -> str:
    """How many pictures matched pairs join."""
    largest = len(groups[0])
    if largest == 1:
        return "no two pictures are joined by a matched pair"
    alone = sum(len(g) == 1 for g in groups)
    joined = len(groups) - alone
    text = f"matched pairs join {sum(len(g) for g in groups) - alone} pictures"
    if joined > 1:
        text += f" into {joined} groups, the largest of {largest}"
    return text + (f"; {alone} picture{'s' * (alone != 1)} joined to none" if alone else "")
