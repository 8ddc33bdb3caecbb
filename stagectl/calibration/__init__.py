"""Friction measured at fixed sites: which sites are due, what is done there, what came of it."""
