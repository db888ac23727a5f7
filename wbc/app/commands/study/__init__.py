"""`wbc study`: studies, their runs, tables and figures."""
