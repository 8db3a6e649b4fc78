"""Depth from several calibrated pictures: plane sweep, semi-global smoothing, consistency, fusion."""
