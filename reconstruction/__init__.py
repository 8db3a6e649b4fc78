"""From historical images to a garment mesh with a warp field (not built yet; see the table in README.md)."""
