"""The emergency stop: a source of frames that must stay alive."""
