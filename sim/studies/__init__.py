"""Studies: trials, sweeps, the journal of their results, and tables and statistics made from it.

A new study is a function in `catalog` with one line in its table, or a JSON file of your own; a new kind of trial is
registered with `register_trial`.
"""
