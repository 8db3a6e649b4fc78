"""What the silk paper prints in its Figures 4 to 7 and Table 2, to stand beside: its data are not public, not comparable.

L. Zhang, B. Xia, F. Ai, Digital Restoration of Tang Dynasty Clothing Structure and Fiber Material Simulation Based on 3D
Reconstruction (docs/theory.md, reference 7). Where its text gives a range only, so is it here: the figures cannot be read.
"""

from __future__ import annotations

LABEL = "paper, other data"
NOTE = (
    "Hollow marks are what the paper prints for its own data, which are not public: other garments, other pictures, another truth. "
    "They show orders of magnitude and decide nothing."
)
METHODS = ("MFAR", "MVS", "Pix2Vex")
GARMENTS = ("round-collar-robe", "half-sleeve", "flying-ribbon", "veil-hat")
DISTANCE_MM = {
    "MFAR": dict(zip(GARMENTS, (3.4, 4.2, 5.1, 6.9), strict=True)),
    "MVS": dict(zip(GARMENTS, (12.3, 9.6, 11.0, 13.8), strict=True)),
    "Pix2Vex": dict(zip(GARMENTS, (8.5, 7.7, 9.3, 10.0), strict=True)),
}
"""Figure 4, "average Hausdorff distance", mm: by its formula a mean distance of nearest points."""
KEYPOINTS_PX = {"MFAR": (2.7, 2.3, 3.4), "MVS": (6.3, 5.4, 7.2), "Pix2Vex": (4.9, 4.1, 5.5)}
"""Figure 5, RMSE over the twelve points, px: mean, least, largest."""
SPECTRUM = {"MFAR": (0.936, 0.964), "MVS": (0.63, 0.731), "Pix2Vex": (0.762, 0.824)}
"""Figure 6, similarity of spectra: least and largest of eight pairs."""
GROUPS = ("collar and closure", "sleeve and hem", "silhouette", "accessories", "texture and pattern")
GROUP_SIZES = (7, 6, 5, 5, 4)
FEATURES_PERCENT = {
    "MFAR": dict(zip(GROUPS, (90.6, 94.7, 93.1, 92.2, 89.1), strict=True)),
    "MVS": dict(zip(GROUPS, (61.6, 60.6, 68.7, 66.0, 67.1), strict=True)),
    "Pix2Vex": dict(zip(GROUPS, (75.1, 81.8, 80.8, 76.5, 76.3), strict=True)),
}
"""Figure 7, share of the 27 features, %."""
TIMES_S = {"MFAR": (48.3, 112.7, 161.0), "MVS": (156.2, 189.5, 345.7), "Pix2Vex": (89.6, 205.3, 294.9)}
"""Table 2: reconstruction, simulation, both, s, on 18 cores and a P100."""
