"""What people run: commands, recipes, sequencing, stores and reports of a two-axis stage."""
