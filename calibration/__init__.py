"""Inverse finite elements: measured curves and a virtual test give parameters, and how well they are known."""
