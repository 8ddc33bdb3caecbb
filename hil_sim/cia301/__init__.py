"""The communication profile of a virtual drive (CiA 301): objects, SDO, PDO, NMT, EMCY."""
