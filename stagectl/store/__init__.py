"""Files of a run: journal, recording, summary, bus log.

`journal` (during the run), `recovery` (from there to the recording), `recording` (HDF5;
`hdf5`, `ledger`), `bus_log` (`frame_spool`, `asc_log`) and `log_reader`, `summary`, `foreign` and
`columns` (data of other programs), `atomic`.

Names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.on_first_use import on_first_use

if TYPE_CHECKING:
    from stagectl.store.asc_log import LOG_NAME, find_log
    from stagectl.store.atomic import write_atomically
    from stagectl.store.bus_log import SPOOL_NAME, BusLog, recover_log
    from stagectl.store.foreign import import_recording
    from stagectl.store.journal import (
        FILE_NAME,
        SAMPLE_TAG,
        AxisScaling,
        Journal,
        JournalHeader,
        refuse_in_progress,
        sample_codec,
        sample_dtype,
    )
    from stagectl.store.ledger import CycleLedger
    from stagectl.store.log_reader import LoggedFrame, read_log
    from stagectl.store.recording import (
        RunNotes,
        read_ledger,
        read_notes,
        read_recording,
        write_recording,
    )
    from stagectl.store.recovery import (
        RECORDING_NAME,
        RECOVERED_NAME,
        read_journal_notes,
        recover_folder,
        recover_journal,
        recover_left_over,
    )
    from stagectl.store.summary import (
        FrictionEntry,
        ParameterEstimate,
        Retry,
        RunFacts,
        build_summary,
        finite,
        write_summary,
    )

__all__ = [
    "FILE_NAME",
    "LOG_NAME",
    "RECORDING_NAME",
    "RECOVERED_NAME",
    "SAMPLE_TAG",
    "SPOOL_NAME",
    "AxisScaling",
    "BusLog",
    "CycleLedger",
    "FrictionEntry",
    "Journal",
    "JournalHeader",
    "LoggedFrame",
    "ParameterEstimate",
    "Retry",
    "RunFacts",
    "RunNotes",
    "build_summary",
    "find_log",
    "finite",
    "import_recording",
    "read_journal_notes",
    "read_ledger",
    "read_log",
    "read_notes",
    "read_recording",
    "recover_folder",
    "recover_journal",
    "recover_left_over",
    "recover_log",
    "refuse_in_progress",
    "sample_codec",
    "sample_dtype",
    "write_atomically",
    "write_recording",
    "write_summary",
]

__getattr__ = on_first_use(
    __name__,
    {
        "asc_log": ("LOG_NAME", "find_log"),
        "atomic": ("write_atomically",),
        "bus_log": ("SPOOL_NAME", "BusLog", "recover_log"),
        "foreign": ("import_recording",),
        "journal": (
            "FILE_NAME",
            "SAMPLE_TAG",
            "AxisScaling",
            "Journal",
            "JournalHeader",
            "refuse_in_progress",
            "sample_codec",
            "sample_dtype",
        ),
        "ledger": ("CycleLedger",),
        "log_reader": ("LoggedFrame", "read_log"),
        "recording": ("RunNotes", "read_ledger", "read_notes", "read_recording", "write_recording"),
        "recovery": (
            "RECORDING_NAME",
            "RECOVERED_NAME",
            "read_journal_notes",
            "recover_folder",
            "recover_journal",
            "recover_left_over",
        ),
        "summary": (
            "FrictionEntry",
            "ParameterEstimate",
            "Retry",
            "RunFacts",
            "build_summary",
            "finite",
            "write_summary",
        ),
    },
)
