"""CANopen as the host speaks it: bus, nodes, SDO, PDO mappings, EMCY, another host on the bus."""
