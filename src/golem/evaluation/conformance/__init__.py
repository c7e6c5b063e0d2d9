"""Public test suites, one per slot: whether a module keeps what its contract asks for."""
