"""The commands of `wbc`: one module a subject; a new command is a function here with a line in `COMMANDS`.

Words such as the name of a study are parameters of the function. Options are the fields of a settings class (or of
several) that it takes as `options: Flat[…]`; their defaults, ranges, choices and help come from that class. Fields of a
spec become options by an annotation `wbc.app.arguments.Fields`. The function also takes `output: OutputOptions`, is
decorated with `wbc.app.output.reports` and returns `output.report(…)`.
"""

GROUPS = {
    "study": "Run many walks, continue where they stopped, and compare them.",
    "bench": "Measure the library itself.",
}
"""Commands that have commands of their own."""

COMMANDS = {
    "walk": (
        "walk:walk",
        "Walk in the simulator, and report how far the robot came and how well. A fall is a result like any other.",
    ),
    "stand": (
        "balance:stand",
        "Let a robot stand in the simulator, and report how still it stands and how fast the controller is.",
    ),
    "push": (
        "balance:push",
        "Push standing robots on the torso from all sides: largest impulse per kg that they recover from.",
    ),
    "hands": (
        "hands:hands",
        "Press on a surface, hold on to a wall on one foot, push and pull a cart, open a door, carry a load.",
    ),
    "motion": ("motion:motion", "Make, check, filter or track a clip of joint positions."),
    "view": (
        "view_log:view",
        "Replay a log in the browser with a time slider, or write it as a page or a film.",
    ),
    "plot": (
        "plot:plot",
        "Draw figures from one log, or compare several: balance, plan, feet, torque, timing, stiffness, any signals.",
    ),
    "robots": (
        "robots:robots",
        "List the robots, describe one, check the file of one of your own, or add it under a name for --robot.",
    ),
    "foot": (
        "foot:foot",
        "List the feet, or test one on a rig: press it on a ground, or pitch its ankle.",
    ),
    "terrain": (
        "terrain:terrain",
        "Describe or draw a ground, or list the families of grounds and the scenes with their parameters.",
    ),
    "stiffness": (
        "stiffness:stiffness",
        "Make a stiffness model of a table, or validate models on grounds that they were not trained on.",
    ),
    "study show": (
        "study.show:show",
        "Print a study as JSON, to be changed and run, or list those that come with the library.",
    ),
    "study run": (
        "study.run:run",
        "Run the trials of a study that its journal does not have; it can be stopped, and continues from there.",
    ),
    "study table": (
        "study.show:table",
        "Make a table of a study from its journal, a figure, a spreadsheet, or data to learn from.",
    ),
    "study optimize": (
        "study.optimize:optimize",
        "Find the best stiffness and gains of grounds (the paper's section III), and which stiffnesses are as good.",
    ),
    "study paper": (
        "study.paper:paper",
        "Run all experiments of the paper and the questions beside them, and write their report.",
    ),
    "check-plant": (
        "check_plant:check_plant",
        "Check a loop by exciting it a little: order, signs, units, frames, gains, delay and clock, each by name.",
    ),
    "bench tick": (
        "bench:tick",
        "Time a tick of the controller: two soles, a swaying centre of mass, posture, joint and torque limits.",
    ),
    "bench walk": (
        "bench:walk",
        "Time the closed loop of walks, and divide it: physics, observer, stabilizer, QP and the rest.",
    ),
    "bench solver": (
        "bench:solver",
        "Solve random problems, check every solution, and compare a sample with ProxQP; 100,000 ticks take minutes.",
    ),
}
"""Words of a command → place of its function in this folder, and its line in the help.

A module is imported when its command runs or is asked for help, and not to list the commands."""
