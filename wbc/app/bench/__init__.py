"""Benchmarks behind `wbc bench`: tick, solver (with its problem streams) and walk (with its profile).

A new benchmark is a module with a settings class `Bench…Options` and a function `bench_…`, and a command in
`wbc.app.commands.bench`.
"""
