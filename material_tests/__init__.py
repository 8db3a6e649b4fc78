"""The virtual textile laboratory: one module a standard test, built on mfar_fem."""
