"""Benchmarks behind `wbc bench`: tick, solver, physics and walk. A new benchmark is a file here."""
