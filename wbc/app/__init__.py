"""The `wbc` command: command line, logs, plots, replay, live view and benchmarks."""
