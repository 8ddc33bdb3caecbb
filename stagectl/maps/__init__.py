"""Friction maps: built from the history, kept in versions, used and tracked in production."""
