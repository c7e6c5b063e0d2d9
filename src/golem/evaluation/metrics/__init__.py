"""From trial records to the figures that are quoted."""
