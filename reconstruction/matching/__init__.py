"""Matching of pictures from different sources (silk paper, formulas 2 and 3): features, pairs, epipolar geometry, match graph.

:func:`match_pair` judges one pair, :class:`MatchGraph` holds a set, :func:`reconstruction.matching.fusion.fuse` runs a folder of
sources, :func:`reconstruction.matching.study.study` measures it all on photographs with known cameras.
"""

from reconstruction.matching.features import Features, detect
from reconstruction.matching.graph import MatchGraph
from reconstruction.matching.pair import PairResult, match_pair
from reconstruction.matching.settings import MatchSettings

__all__ = ["Features", "MatchGraph", "MatchSettings", "PairResult", "detect", "match_pair"]
