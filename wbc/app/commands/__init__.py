"""The commands of `wbc`, one module each; this table is the one place where a command is made known.

A command is a function that takes its configuration class as `options: Flat[…]` and `output: OutputOptions`, is
decorated with `wbc.app.output.reports`, and returns `output.report(…)`. Its options, their defaults and their help
come from the configuration class; nothing is written twice.
"""

GROUPS = {
    "bench": "Measure the library itself.",
    "foot": "Test one foot on a rig.",
}
"""Commands that have commands of their own."""

COMMANDS = {
    "robots": "wbc.app.commands.robots:robots",
    "stand": "wbc.app.commands.stand:stand",
    "push": "wbc.app.commands.push:push",
    "bench tick": "wbc.app.commands.bench:tick",
    "bench solver": "wbc.app.commands.bench:solver",
    "foot press": "wbc.app.commands.foot:press",
    "terrain": "wbc.app.commands.terrain:terrain",
    "terrains": "wbc.app.commands.terrain:terrains",
}
"""Words of a command → where its function is. A module is imported when its command, or the help, needs it."""
