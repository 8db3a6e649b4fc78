"""From a folder of sources to a draped garment: the stages one after the other, kept by content."""
