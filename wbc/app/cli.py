"""The command `wbc`: reads the command line, runs a command and turns errors into exit codes."""

from __future__ import annotations

import errno
import importlib
import io
import os
import sys
import traceback
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Parameter

from wbc._version import __version__
from wbc.app.arguments import plain_options, prepare
from wbc.app.commands import COMMANDS, GROUPS
from wbc.core.errors import InputError, WbcError

RAN, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: ran (whatever the result), failed, input that cannot be used, stopped by Ctrl-C."""

LONGEST_LINE = 1000
"""Longest line that says why a command line is refused, characters."""


def make_app(first_word: str | None = None) -> App:
    """Build the command-line application from the table of commands.

    Args:
        first_word: First word of the command line. Modules of other commands are not imported, which saves most of
            a second; without a word, or with an unknown one, all are imported, for the help and for hints.
    """
    options = {"default_parameter": Parameter(negative=()), "help_format": "markdown"}
    app = App(
        name="wbc",
        help="Whole-body QP control for humanoids: tasks, contacts and limits, solved at every tick.",
        help_epilogue="Exit codes: 0 ran, 1 failed, 2 bad input.",
        version=__version__,
        config=(prepare,),
        **options,
    )
    groups: dict[str, App] = {}
    known = {words.split()[0] for words in COMMANDS}
    for words, place in COMMANDS.items():
        *group, name = words.split()
        if name in GROUPS and not group:
            group, name = [name], ""
        if first_word in known and first_word != words.split()[0]:
            continue
        parent = app
        if group:
            if group[0] not in groups:
                groups[group[0]] = App(name=group[0], help=GROUPS[group[0]], **options)
                app.command(groups[group[0]])
            parent = groups[group[0]]
        module, _, function = place.partition(":")
        run = plain_options(getattr(importlib.import_module(module), function))
        if name:
            parent.command(run, name=name)
        else:
            parent.default(run)
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Words after `wbc`; those of the process when None.

    Returns:
        Exit code.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± must not lose a result
    try:
        make_app(next((word for word in words if not word.startswith("-")), None))(
            words,
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
        print(end="", flush=True)  # there may be no stdout
    except (CycloptsError, InputError) as error:
        print(f"wbc: {_one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    except WbcError as error:
        print(f"wbc: {_one_line(error)}", file=sys.stderr)
        return FAILED
    except MemoryError:
        print("wbc: out of memory; ask for less", file=sys.stderr)
        return FAILED
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return RAN
    except OSError as error:  # a full disk, a device that is gone
        try:
            sys.stdout.flush()
        except OSError:  # what could not be printed is not tried again at the end
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        print(f"wbc: {_one_line(error)}", file=sys.stderr)
        return BAD_INPUT if error.errno == errno.ENAMETOOLONG else FAILED
    except KeyboardInterrupt:
        print("wbc: interrupted", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        print("wbc: internal failure; please report it with the lines above", file=sys.stderr)
        return FAILED
    return RAN


def _one_line(error: BaseException) -> str:
    line = " ".join(str(error).split()).encode("utf-8", "backslashreplace").decode()
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3]}..."


if __name__ == "__main__":
    sys.exit(main())
