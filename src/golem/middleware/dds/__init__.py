"""DDS transport of raw CDR: one contract (`base`), over Cyclone DDS (`participant`) or inside one process (`local`)."""
