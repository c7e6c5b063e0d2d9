"""Studies: many ladders in one folder, with one report, one family of comparisons, and tables for documents."""
