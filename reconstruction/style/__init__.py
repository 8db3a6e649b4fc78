"""Style alignment: one picture given the look of another while what it shows stays (silk paper, formula (4)), and its worth.

:mod:`colour_transfer` needs numpy alone; the networks need torch (extra ``torch``), matching and edges OpenCV (extra ``recon``).
"""
