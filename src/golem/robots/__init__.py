"""Layer 1: robots behind one contract, real or simulated, with their model, sensors and worlds."""
