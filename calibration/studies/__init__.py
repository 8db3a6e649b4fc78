"""Longer studies of the calibration itself, one module each; `calibration.studies_cli` runs them as ``mfar study NAME``.

- `round_trip`: is a synthetic truth found again, and do the intervals cover it?
- `cupro`: every law by finite elements on the measured cupro strips, and why a law cannot do it.
- `sensitivities`: exact derivatives against central differences, and that load steps do not matter.
- `mesh`: what the mesh does to the force of an oblique strip and to the parameters fitted on it.
"""
