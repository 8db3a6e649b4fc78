"""The command line ``mfar``: one lazily loaded module a command group."""
