"""The commands of `wbc`, one module each; this table is the one place where a command is made known.

A command is a function that takes its configuration class as `options: Flat[…]` and `output: OutputOptions`, is
decorated with `wbc.app.output.reports`, and returns `output.report(…)`. Its options, their defaults and their help
come from the configuration class; nothing is written twice.
"""

GROUPS = {
    "bench": "Measure the library itself.",
    "foot": "Test one foot on a rig.",
    "study": "Run many walks, and go on where they stopped.",
    "stiffness": "Learn the stiffness of a sole from the roughness of the ground.",
}
"""Commands that have commands of their own."""

COMMANDS = {
    "robots": "wbc.app.commands.robots:robots",
    "stand": "wbc.app.commands.stand:stand",
    "walk": "wbc.app.commands.walk:walk",
    "push": "wbc.app.commands.push:push",
    "bench tick": "wbc.app.commands.bench:tick",
    "bench solver": "wbc.app.commands.bench:solver",
    "bench physics": "wbc.app.commands.physics:physics",
    "bench walk": "wbc.app.commands.walk_cost:walk",
    "feet": "wbc.app.commands.feet:feet",
    "foot press": "wbc.app.commands.foot:press",
    "foot drop": "wbc.app.commands.foot:drop",
    "foot slide": "wbc.app.commands.foot:slide",
    "foot pitch": "wbc.app.commands.foot:pitch",
    "foot curves": "wbc.app.commands.foot_study:curves",
    "foot stability": "wbc.app.commands.foot_study:stability",
    "terrain": "wbc.app.commands.terrain:terrain",
    "terrains": "wbc.app.commands.terrain:terrains",
    "study list": "wbc.app.commands.study:list_studies",
    "study show": "wbc.app.commands.study:show",
    "study run": "wbc.app.commands.study:run",
    "study table": "wbc.app.commands.study:table",
    "study plot": "wbc.app.commands.study:plot",
    "study export": "wbc.app.commands.study:export",
    "study swings": "wbc.app.commands.study:swings",
    "study best": "wbc.app.commands.study:best",
    "study heights": "wbc.app.commands.study:heights",
    "study dataset": "wbc.app.commands.study:dataset",
    "stiffness train": "wbc.app.commands.stiffness:train",
    "stiffness judge": "wbc.app.commands.stiffness:judge",
    "plot": "wbc.app.commands.plot:plot",
    "view": "wbc.app.commands.view_log:view",
}
"""Words of a command → where its function is. A module is imported when its command, or the help, needs it."""
