"""The cutting template: B-spline edges, panels of straight-cut garments, their checks, and files at true scale."""
