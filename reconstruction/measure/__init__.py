"""Measurements of garments in one system of units: scales, poses, lengths with uncertainty, and the vote between sources."""
