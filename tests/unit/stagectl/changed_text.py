"""A file's text with a key changed, and the place in it that a problem has to name."""

import re


def changed_text(text, new):
    """The text with the first value of the key that `new` begins with replaced by all of `new`.

    `^` in it marks a place, which comes back as `line:column`; "" without. After `KEY ->`, the text
    stands in place of the key itself, too.
    """
    key, arrow, other = new.partition(" -> ")
    if not arrow:
        key, other = new.partition(":")[0].lstrip("^"), new
    found = re.search(rf"\b{key}: (\[[^]]*\]|{{[^{{}}]*}}|[^,\s}}]+)", text)
    assert found is not None
    changed = text[: found.start()] + other + text[found.end() :]
    before, mark, after = changed.partition("^")
    place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
    return before + after, place if mark else ""
