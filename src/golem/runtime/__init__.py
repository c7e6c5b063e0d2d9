"""The composition root: thin nodes that connect passive modules to the bus, and the clock that drives them."""
