"""How modules exchange messages: one in-process bus today, DDS behind the same words later."""
