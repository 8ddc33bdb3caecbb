"""Objects by index: none twice, and each CiA 402 one is what the virtual drive's EDS calls it."""

import re

import canopen

from drivers import objects as od
from drivers.objects import ObjectRef

OBJECTS = [value for value in vars(od).values() if isinstance(value, ObjectRef)]


def test_an_object_is_shown_with_index_subindex_and_name():
    assert str(od.FEED) == "0x6092:01 feed"
    assert str(ObjectRef(0x2001, 16, "")) == "0x2001:10"


def test_no_entry_stands_twice():
    places = [(o.index, o.sub) for o in OBJECTS]
    assert len(places) == len(set(places)) > 60


def test_names_are_those_of_the_eds(eds):
    """A name shares a word with the EDS, so that no constant has its neighbour's index."""
    dictionary = canopen.import_od(str(eds), 1)

    def words(text):
        return set(re.findall(r"[a-z]{3,}", text.lower()))

    shared = 0
    for ref in OBJECTS:
        variable = dictionary.get_variable(ref.index, ref.sub)
        if variable is None:
            continue
        parent = dictionary[ref.index].name
        assert words(ref.name) & (words(variable.name) | words(parent)), (str(ref), variable.name)
        shared += 1
    assert shared > 50
