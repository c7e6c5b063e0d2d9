"""RTPS by hand, as little of it as services to clients of Fast DDS take."""
