"""The EDS that we ship, beyond what Lely's checker asks (tests/hil/test_third_party_tools.py)."""

import configparser
import logging
import re

import canopen
import pytest
from canopen.objectdictionary import ODVariable, datatypes

from hil_sim.cia301 import EDS_PATH

PROMISED = (
    "1000 1001 1003 1005 1006 1007 1008 1009 100A 1014 1016 1017 1018 1200 6040 6041 6060 6061 "
    "6502 607A 6064 606C 6077 60B2 60F4 6065 6066 6067 6068 6071 6072 6073 6074 6075 6076 607D "
    "6081 6083 6084 6085 6098 6099 609A 60C2 605A 605B 605C 605D 605E 6007 608F 6091 6092 603F "
    "607C 1400 1401 1402 1403 1600 1601 1602 1603 1800 1801 1802 1803 1A00 1A01 1A02 1A03 2000"
).split()
TYPES = {
    datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32, datatypes.UNSIGNED8,
    datatypes.UNSIGNED16, datatypes.UNSIGNED32, datatypes.REAL32, datatypes.REAL64,
    datatypes.VISIBLE_STRING,
}  # fmt: skip


@pytest.fixture(scope="module")
def eds():
    parser = configparser.RawConfigParser(strict=True)  # a duplicate section or key is an error
    parser.optionxform = str
    parser.read(EDS_PATH)
    return parser


@pytest.fixture(scope="module")
def dictionary():
    return canopen.import_od(str(EDS_PATH), 5)


def variables(dictionary):
    for entry in dictionary.values():
        yield from [entry] if isinstance(entry, ODVariable) else entry.values()


def test_canopen_loads_it_without_a_warning(caplog):
    with caplog.at_level(logging.WARNING):
        canopen.objectdictionary.import_od(str(EDS_PATH), 1)
    assert caplog.records == []


def test_promised_objects_are_there(dictionary):
    assert [i for i in PROMISED if int(i, 16) not in dictionary] == []


def test_sub_numbers_match_the_sub_objects(eds):
    for section in eds.sections():
        if not re.fullmatch("[0-9A-F]{4}", section) or eds[section]["ObjectType"] == "0x7":
            continue
        subs = [int(s[7:], 16) for s in eds.sections() if re.fullmatch(section + "sub[0-9A-F]+", s)]
        assert int(eds[section]["SubNumber"]) == len(subs), section
        highest = eds[section + "sub0"]["DefaultValue"]
        if not section.startswith(("16", "1A")) and section != "1003":
            assert int(highest, 0) == max(subs), section


def test_types(dictionary):
    for v in variables(dictionary):
        where = f"{v.index:04X}:{v.subindex}"
        assert v.data_type in TYPES, where
        assert v.name, where
        if v.default is not None and v.data_type != datatypes.VISIBLE_STRING:
            v.encode_raw(v.default)  # fits its type


def test_file_and_device_information(eds, dictionary):
    info, device = eds["FileInfo"], eds["DeviceInfo"]
    for key in (
        "FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime",
        "CreationDate", "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy",
    ):  # fmt: skip
        assert info[key], key
    assert info["FileName"] == EDS_PATH.name
    assert int(device["VendorNumber"], 0) == dictionary[0x1018][1].default
    assert int(device["ProductNumber"], 0) == dictionary[0x1018][2].default
    assert int(device["RevisionNumber"], 0) == dictionary[0x1018][3].default
    assert (int(device["NrOfRXPDO"]), int(device["NrOfTXPDO"])) == (4, 4)
    lines = int(eds["Comments"]["Lines"])
    assert all(f"Line{n}" in eds["Comments"] for n in range(1, lines + 1))


def test_drive_serves_every_readable_object(host):
    for v in variables(canopen.import_od(str(EDS_PATH), 1)):
        if v.index == 0x1003 and v.subindex:
            continue  # empty
        if v.data_type == datatypes.REAL64 or v.data_type == datatypes.VISIBLE_STRING:
            host.upload(1, v.index, v.subindex)
        else:
            host.request(1, bytes((0x40, v.index & 0xFF, v.index >> 8, v.subindex, 0, 0, 0, 0)))
