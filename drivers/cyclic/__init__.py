"""The cyclic path: setpoints out, SYNC, process data in; no SDO in here."""
