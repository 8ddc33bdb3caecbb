"""The application: commands, files, runs, records and reports of a two-axis stage."""
