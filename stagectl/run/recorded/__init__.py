"""A run from what it recorded, when it ends or later.

`summarise` and `documents` (summary and page), `listing` (the runs in a folder), `resume` (where to
continue an interrupted one; what to type is in its summary).
"""
