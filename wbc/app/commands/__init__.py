"""The commands of `wbc`: one module a subject; a new command is a function here with a line in `COMMANDS`.

Words such as the name of a study are parameters of the function. A parameter that is settings becomes an option for
each of its fields; defaults, ranges, choices and help come from there. Chosen fields of a spec become options by an
annotation `wbc.app.arguments.Fields`. The function is decorated with `wbc.app.output.reports`, which adds the options
of the output, and returns a `Report`.
"""

import re
from pathlib import Path

GROUPS = {
    "bench": "Measure the library itself.",
    "study": "Run many walks, continue where they stopped, and compare them.",
}
"""Commands that have commands of their own."""

COMMANDS = {
    "walk": "walk:walk",
    "stand": "stand:stand",
    "motion": "motion:motion",
    "view": "view_log:view",
    "plot": "plot:plot",
    "robots": "robots:robots",
    "foot": "foot:foot",
    "terrain": "terrain:terrain",
    "settings": "settings:settings",
    "study show": "study:show",
    "study run": "study:run",
    "study table": "study:table",
    "study plot": "study:plot",
    "bench tick": "bench:tick",
}
"""Words of a command → place of its function in this folder.

A module is imported when its command runs or is asked for help, and not to list the commands."""


def summary(words: str) -> str:
    """Return the line of a command in the list of commands: the first of its function's docstring, read as text."""
    module, _, function = COMMANDS[words].partition(":")
    file = Path(__file__).parent / f"{module.replace('.', '/')}.py"
    text = file.read_text(encoding="utf-8")
    found = re.search(rf'^def {function}\(.*?"""(.*?)(?:"""|\n)', text, re.DOTALL | re.MULTILINE)
    return "" if found is None else found[1]
