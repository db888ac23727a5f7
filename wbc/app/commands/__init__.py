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
    "robots": (
        "robots:robots",
        "List the robots, or describe one: limits, posture, servo gains, soles and what was derived.",
    ),
    "robots check": (
        "robots:check",
        "Read the file of a robot and report what is in it, what was derived and what is doubtful.",
    ),
    "robots add": (
        "robots:add",
        "Write a TOML description of a robot to the user's configuration folder: --robot takes its name from then on.",
    ),
    "stand": (
        "balance:stand",
        "Let a robot stand in the simulator, and report how still it stands and how fast the controller is.",
    ),
    "walk": (
        "walk:walk",
        "Walk in the simulator, and report how far the robot came and how well. A fall is a result like any other.",
    ),
    "push": (
        "balance:push",
        "Push standing robots on the torso from all sides: largest impulse per kg that they recover from.",
    ),
    "carry": (
        "balance:carry",
        "Hand a load of unknown mass to a robot; it finds mass and place, carries the load and lets go of it.",
    ),
    "hands press": (
        "hands:press",
        "Press with both hands on a table, a wall or a rail, and report the force that is held.",
    ),
    "hands one-foot": ("hands:one_foot", "Push a robot that stands on one foot with a hand on a wall."),
    "hands cart": (
        "hands:cart",
        "Push a cart forward, turn it about its middle, pull it back, and report where it has come to stand.",
    ),
    "hands door": ("hands:door", "Open a door by its handle while walking, let go, and walk on."),
    "check-plant": (
        "check_plant:check_plant",
        "Check a loop by exciting it a little: order, signs, units, frames, gains, delay and clock, each by name.",
    ),
    "bench tick": (
        "bench:tick",
        "Time a tick of the controller: two soles, a swaying centre of mass, posture, joint and torque limits.",
    ),
    "bench solver": (
        "bench:solver",
        "Solve random problems, check every solution, and compare a sample with ProxQP; 100,000 ticks take minutes.",
    ),
    "bench physics": (
        "bench:physics",
        "Steps per second of a robot that its servos keep standing, with each sole on each ground.",
    ),
    "bench walk": (
        "bench:walk",
        "Time the closed loop of walks, and divide it: physics, observer, stabilizer, QP and the rest.",
    ),
    "bench record": (
        "bench:record",
        "Repeat tick, solver and walk, and write all samples with machine, versions and commit; takes some minutes.",
    ),
    "bench compare": (
        "bench:compare",
        "Say what became slower between two records of `wbc bench record`, beyond the noise of their repeats.",
    ),
    "feet": (
        "foot.feet:feet",
        "List the feet: how they fit every robot, what mass and height they add, and their parameters.",
    ),
    "foot press": (
        "foot.tests:press",
        "Drop one foot onto a ground, let it settle under a load and look at it: forces, contacts, support, sole.",
    ),
    "foot drop": ("foot.tests:drop", "Drop one foot from higher up: what its sole takes of a hard landing."),
    "foot slide": (
        "foot.tests:slide",
        "Push one loaded foot forward: how it creeps under a shear, and at which shear it slides.",
    ),
    "foot pitch": (
        "foot.tests:pitch",
        "Pitch the ankle of one loaded foot toe down, toe up and back: how the centre of pressure follows.",
    ),
    "foot curves": (
        "foot.study:curves",
        "Contact area, support area and ankle height over stiffness, and force–deflection curves; about a minute.",
    ),
    "foot stability": (
        "foot.study:stability",
        "Press a soft foot for every stiffness, ground and physics step: does it diverge, is it quiet; takes minutes.",
    ),
    "terrain": ("terrain:terrain", "Describe a ground, and draw or measure it if asked to."),
    "terrains": (
        "terrain:terrains",
        "List the families of grounds with their parameters; draw all of them, or measure what they cost.",
    ),
    "scenes": (
        "terrain:scenes",
        "List the scenes that `wbc walk --scene` and `Plant(scene=…)` take, with their parameters.",
    ),
    "study list": ("study.show:list_studies", "List the studies that come with the library."),
    "study show": ("study.show:show", "Print a study as JSON, to be changed and run."),
    "study run": (
        "study.run:run",
        "Run the trials of a study that its journal does not have. It can be stopped, and continues from there.",
    ),
    "study rerun": (
        "study.run:rerun",
        "Run one trial of a journal again, in this process; the journal is only read.",
    ),
    "study table": (
        "study.show:table",
        "Make the table of a study: means with intervals, paired differences, how walks ended. As Markdown or JSON.",
    ),
    "study plot": (
        "study.show:plot",
        "Draw the table of a study: each arm's mean and its difference to the reference, with intervals.",
    ),
    "study export": (
        "study.show:export",
        "Write all results of a study to a table, for a spreadsheet or a data frame.",
    ),
    "study swings": (
        "study.show:swings",
        "Sum up the swings of soles of variable stiffness: reached in time, error of the scan, time before touch-down.",
    ),
    "study best": (
        "study.stiffness:best",
        "Find the best stiffness of each cell of a study whose arms are stiffnesses, from its journal.",
    ),
    "study choice": (
        "study.stiffness:choice",
        "Find the best arm of each ground, and what choosing it there is worth over the best single one.",
    ),
    "study heights": (
        "study.stiffness:heights",
        "Find the height of each ground at which half of the walks are completed, from a journal.",
    ),
    "study optimize": (
        "study.optimize:optimize",
        "Find the best stiffness and gains of grounds (the paper's section III), and which stiffnesses are as good.",
    ),
    "study paper": (
        "study.paper:paper",
        "Run all experiments of the paper and the questions beside them, and write their report.",
    ),
    "study dataset": (
        "study.stiffness:dataset",
        "Find the best stiffness for ground and amplitude, and write the table that a stiffness model learns from.",
    ),
    "stiffness train": (
        "stiffness:train",
        "Make a stiffness model of a table, and write it as plain numbers.",
    ),
    "stiffness judge": (
        "stiffness:judge",
        "Validate models on grounds that they were not trained on, and analyse the table; about a minute.",
    ),
    "motion make": ("motion:make", "Make a motion by rule: a clip to begin with."),
    "motion check": (
        "motion:check",
        "Measure a clip as it is: limits, speeds, feet on the ground, ZMP in the supports.",
    ),
    "motion filter": (
        "motion:make_clip_feasible",
        "Make a clip feasible: limits, speeds, feet that stand still, ZMP in the supports; report what was changed.",
    ),
    "motion track": (
        "motion:track",
        "Track a clip in the simulator while balancing: on both feet, on one, and where it steps.",
    ),
    "plot": (
        "plot:plot",
        "Draw figures from one log, or compare several: balance, plan, feet, torque, timing, stiffness, any signals.",
    ),
    "view": (
        "view_log:view",
        "Replay a log in the browser with a time slider, or write it as a page or a film.",
    ),
}
"""Words of a command → place of its function in this folder, and its line in the help.

A module is imported when its command runs or is asked for help, and not to list the commands."""
