"""Inverse finite elements: measured curves and a virtual test give parameters, with proof of how well they are known."""
