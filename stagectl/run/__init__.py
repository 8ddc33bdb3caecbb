"""One run, from a recipe to its files: session, record, resume, retries, replay."""
