"""What a run leaves behind: journal, recording, summary, bus log."""
