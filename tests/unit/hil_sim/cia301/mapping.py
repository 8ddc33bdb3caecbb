"""PDOs mapped as CiA 301 demands."""

VALID_T1, OFF = 0x40000181, 1 << 31


def remap(host, mapping, communication, entries, cob, kind=1):
    host.write(1, communication, 1, "I", cob | OFF)
    host.write(1, communication, 2, "B", kind)
    host.write(1, mapping, 0, "B", 0)
    for n, entry in enumerate(entries, 1):
        host.write(1, mapping, n, "I", entry)
    host.write(1, mapping, 0, "B", len(entries))
    host.write(1, communication, 1, "I", cob)
