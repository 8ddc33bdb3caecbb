"""Maps to look at and to take along.

`outline` (what they say), `page`, `as_json` and `export` (for
other programs); `surface` is an axis of a map over the whole table.
"""
