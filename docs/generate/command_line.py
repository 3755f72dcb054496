"""The page of the command line, from its own parsers."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from geomech import cli

OPENING = """# Command line

`geomech VERB --help` prints the same text. Exit codes: 0 done, 1 a run failed (its files remain readable),
2 bad
input, 3 interrupted (Ctrl-C or SIGTERM). `geomech --debug VERB …` shows the traceback of a failure.
`python -m geomech` is
the same program.
"""


def page() -> str:
    """The page as MyST Markdown."""
    parser = argparse.ArgumentParser(prog="geomech")
    verbs = parser.add_subparsers()
    for verb in cli.VERBS:
        verb.declare(verbs)
    return OPENING + "\n" + "\n".join(line for name, verb in verbs.choices.items() for line in _verb(name, verb)) + "\n"


def _verb(name: str, verb: argparse.ArgumentParser) -> Iterator[str]:
    yield f"## geomech {name}\n"
    yield _text(verb.description or "") + "\n"
    yield f"```sh\n{_examples(verb.epilog or '')}\n```\n"
    for action in verb._actions:
        if action.dest == "help" or action.help == argparse.SUPPRESS:
            continue
        written = ", ".join(f"`{option}`" for option in action.option_strings) or f"`{action.metavar or action.dest}`"
        value = action.metavar or (action.dest.upper() if action.option_strings and action.nargs != 0 else "")
        if isinstance(action, argparse.BooleanOptionalAction):
            value = ""
        taken = (
            f" `{' '.join(value) if isinstance(value, tuple) else value}`" if value and action.option_strings else ""
        )
        several = " …" if action.nargs in ("+", "*") else ""
        yield f"{written}{taken}{several}\n:   {_text((action.help or '') % vars(action))}\n"


def _examples(epilog: str) -> str:
    lines = epilog.splitlines()
    return "\n".join(line.strip() for line in lines[1:]) if lines and lines[0].startswith("example") else epilog


def _text(text: str) -> str:
    return text.replace("*", r"\*").replace("<", r"\<").replace("$", r"\$").replace("[", r"\[")
