"""NMT commands and states in words (CiA 301, 7.2.8)."""

from __future__ import annotations

NMT_COMMANDS = {
    1: "start", 2: "stop", 128: "to pre-operational", 129: "reset node", 130: "reset communication"
}  # fmt: skip
NMT_STATES = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}
"""As a heartbeat shows them; 0 is the boot-up message."""
