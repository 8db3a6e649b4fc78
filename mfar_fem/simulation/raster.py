"""A depth buffer for triangles. matplotlib sorts whole triangles by depth and shows a body through the cloth that lies on it."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def rasterise(points, triangles, colours, depth, image):
    """Fill triangles into ``image`` (h, w, 3) where they are nearer than ``depth`` (h, w).

    ``points`` (n, 3) are pixel coordinates and depth (smaller is nearer), ``colours`` (nt, 3, 3) those of the corners, 0 to 1.
    """
    h, w = depth.shape
    for k in range(triangles.shape[0]):
        i, j, m = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        x0, y0, z0 = points[i, 0], points[i, 1], points[i, 2]
        x1, y1, z1 = points[j, 0], points[j, 1], points[j, 2]
        x2, y2, z2 = points[m, 0], points[m, 1], points[m, 2]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if not abs(area) > 1e-12:
            continue
        low_x, high_x = max(0, int(np.floor(min(x0, x1, x2)))), min(w - 1, int(np.ceil(max(x0, x1, x2))))
        low_y, high_y = max(0, int(np.floor(min(y0, y1, y2)))), min(h - 1, int(np.ceil(max(y0, y1, y2))))
        for py in range(low_y, high_y + 1):
            for px in range(low_x, high_x + 1):
                a = ((x1 - px) * (y2 - py) - (x2 - px) * (y1 - py)) / area
                b = ((x2 - px) * (y0 - py) - (x0 - px) * (y2 - py)) / area
                c = 1.0 - a - b
                if a >= -1e-9 and b >= -1e-9 and c >= -1e-9:
                    z = a * z0 + b * z1 + c * z2
                    if z < depth[py, px]:
                        depth[py, px] = z
                        for s in range(3):
                            image[py, px, s] = a * colours[k, 0, s] + b * colours[k, 1, s] + c * colours[k, 2, s]
