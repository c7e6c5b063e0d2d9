"""`golem bringup`: the first hours with a robot, step by step, each one checked before the next."""
