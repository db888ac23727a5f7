"""The commands of `wbc`: one module a subject; a new command is a function here with a line in `COMMANDS`.

Words such as the name of a study are parameters of the function. Options are the fields of a settings class (or of
several) that it takes as `options: Flat[…]`; their defaults, ranges, choices and help come from that class. The
function also takes `output: OutputOptions`, is decorated with `wbc.app.output.reports` and returns `output.report(…)`.
"""

GROUPS = {
    "robots": "List the robots, describe one, check and add robots of your own.",
    "hands": "Press, hold on to a wall, push and pull a cart, open a door.",
    "bench": "Measure the library itself.",
    "foot": "Test one foot on a rig.",
    "study": "Run many walks, and continue where they stopped.",
    "motion": "Make, check, filter and track clips of joint positions.",
    "stiffness": "Learn the stiffness of a sole from the roughness of the ground.",
}
"""Commands that have commands of their own; a command of the same word runs when none of these follows."""

COMMANDS = {
    "robots": "wbc.app.commands.robots:robots",
    "robots check": "wbc.app.commands.robots:check",
    "robots add": "wbc.app.commands.robots:add",
    "stand": "wbc.app.commands.balance:stand",
    "walk": "wbc.app.commands.walk:walk",
    "push": "wbc.app.commands.balance:push",
    "carry": "wbc.app.commands.balance:carry",
    "hands press": "wbc.app.commands.hands:press",
    "hands one-foot": "wbc.app.commands.hands:one_foot",
    "hands cart": "wbc.app.commands.hands:cart",
    "hands door": "wbc.app.commands.hands:door",
    "check-plant": "wbc.app.commands.check_plant:check_plant",
    "bench tick": "wbc.app.commands.bench:tick",
    "bench solver": "wbc.app.commands.bench:solver",
    "bench physics": "wbc.app.commands.bench:physics",
    "bench walk": "wbc.app.commands.bench:walk",
    "bench record": "wbc.app.commands.bench:record",
    "bench compare": "wbc.app.commands.bench:compare",
    "feet": "wbc.app.commands.foot.feet:feet",
    "foot press": "wbc.app.commands.foot.tests:press",
    "foot drop": "wbc.app.commands.foot.tests:drop",
    "foot slide": "wbc.app.commands.foot.tests:slide",
    "foot pitch": "wbc.app.commands.foot.tests:pitch",
    "foot curves": "wbc.app.commands.foot.study:curves",
    "foot stability": "wbc.app.commands.foot.study:stability",
    "terrain": "wbc.app.commands.terrain:terrain",
    "terrains": "wbc.app.commands.terrain:terrains",
    "scenes": "wbc.app.commands.terrain:scenes",
    "study list": "wbc.app.commands.study.show:list_studies",
    "study show": "wbc.app.commands.study.show:show",
    "study run": "wbc.app.commands.study.run:run",
    "study rerun": "wbc.app.commands.study.run:rerun",
    "study table": "wbc.app.commands.study.show:table",
    "study plot": "wbc.app.commands.study.show:plot",
    "study export": "wbc.app.commands.study.show:export",
    "study swings": "wbc.app.commands.study.show:swings",
    "study best": "wbc.app.commands.study.stiffness:best",
    "study choice": "wbc.app.commands.study.stiffness:choice",
    "study heights": "wbc.app.commands.study.stiffness:heights",
    "study optimize": "wbc.app.commands.study.optimize:optimize",
    "study paper": "wbc.app.commands.study.paper:paper",
    "study dataset": "wbc.app.commands.study.stiffness:dataset",
    "stiffness train": "wbc.app.commands.stiffness:train",
    "stiffness judge": "wbc.app.commands.stiffness:judge",
    "motion make": "wbc.app.commands.motion:make",
    "motion check": "wbc.app.commands.motion:check",
    "motion filter": "wbc.app.commands.motion:make_clip_feasible",
    "motion track": "wbc.app.commands.motion:track",
    "plot": "wbc.app.commands.plot:plot",
    "view": "wbc.app.commands.view_log:view",
}
"""Words of a command → module and name of its function. A module is imported when its command or the help needs it."""
