"""The bring-up rehearsed with a twin: what a person would do is scripted, and what could be wrong is built in."""
