"""From oriented points to a triangle mesh that a shell can take: Poisson, trimming, subdivision, ARAP, quality, repair."""
