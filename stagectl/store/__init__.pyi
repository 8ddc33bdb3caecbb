from .asc_log import LOG_NAME, find_log
from .atomic import write_atomically
from .bus_log import SPOOL_NAME, BusLog, recover_log
from .cycle_ledger import CycleLedger
from .journal import (
    FILE_NAME,
    SAMPLE_TAG,
    AxisScaling,
    Journal,
    JournalHeader,
    refuse_in_progress,
    sample_codec,
    sample_dtype,
)
from .journal_reader import read_journal_notes
from .journal_to_recording import (
    MOVED_BY_PROFILE,
    RECORDING_NAME,
    RECOVERED_NAME,
    recording_in,
    recover_folder,
    recover_journal,
    recover_left_over,
)
from .log_reader import LoggedBus, LoggedFrame, read_log
from .recording import (
    RunNotes,
    read_ledger,
    read_notes,
    reading_events,
    write_recording,
)
from .recording_blocks import RecordingBlocks, read_recording
from .summary import finite, summarise_samples

__all__ = [
    "FILE_NAME",
    "LOG_NAME",
    "MOVED_BY_PROFILE",
    "RECORDING_NAME",
    "RECOVERED_NAME",
    "SAMPLE_TAG",
    "SPOOL_NAME",
    "AxisScaling",
    "BusLog",
    "CycleLedger",
    "Journal",
    "JournalHeader",
    "LoggedBus",
    "LoggedFrame",
    "RecordingBlocks",
    "RunNotes",
    "find_log",
    "finite",
    "read_journal_notes",
    "read_ledger",
    "read_log",
    "read_notes",
    "read_recording",
    "reading_events",
    "recording_in",
    "recover_folder",
    "recover_journal",
    "recover_left_over",
    "recover_log",
    "refuse_in_progress",
    "sample_codec",
    "sample_dtype",
    "summarise_samples",
    "write_atomically",
    "write_recording",
]
