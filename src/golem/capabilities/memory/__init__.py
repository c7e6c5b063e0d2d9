"""Where things are and where they were: what posed RGB-D frames showed, asked for by words."""
