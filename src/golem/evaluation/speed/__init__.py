"""How fast this machine runs it; nothing here is a trial."""
