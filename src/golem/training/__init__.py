"""Everything that is trained; never imported at run time."""
