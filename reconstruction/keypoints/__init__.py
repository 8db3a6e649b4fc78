"""Twelve structural points found in images: network, knowledge graph, training, evaluation.

The modules that need torch import it when they are imported; this one imports nothing.
"""
