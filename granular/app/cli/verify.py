"""Command `verify`: reference numbers for other codes, and a check of theirs."""

from __future__ import annotations

import argparse
from collections import Counter

from granular._engine import files
from granular._engine.reports import aligned
from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.cases.case import Option
from granular.studies import verification

RESULT_WORDS = "right", "ill-conditioned", "wrong", "missing"
EXIT_RIGHT, EXIT_NOT_RIGHT = 0, 1
"""Exit codes of a check."""
MAX_PRINTED_ANSWERS = 12
"""Maximum number of printed answers, and of printed wrong numbers."""


class Verify(Command):
    """List or write reference cases for other codes, or check their numbers."""

    USAGE = "[CASE] [-o FILE] [--check FILE.csv [--tolerance NUMBER]]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("case", nargs="?", metavar="CASE", help=f"one of {', '.join(verification.names())}")
        parser.add_argument("-o", "--output", metavar="FILE", help="write the case: .csv (answers) or .json (all)")
        parser.add_argument("--check", metavar="FILE.csv", help="table written by -o, with the values of another code")
        parser.add_argument("--tolerance", type=float, metavar="NUMBER",
                            help="largest relative difference that counts as right [all digits of the table]")
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> int:
        if parsed.case is None:
            if parsed.output or parsed.check:
                raise ValueError(f"{'--check' if parsed.check else '-o'} requires a case: one of "
                                 f"{', '.join(verification.names())}.")
            rows = [[name, verification.case(name)["about"]] for name in verification.names()]
            print(output.wrap_text(aligned(rows, "<")))
            print(output.wrap_text("\ngranular verify CASE -o FILE.csv writes a case.\n"
                                "granular verify CASE --check FILE.csv checks your numbers."))
        elif parsed.check:
            return _check_table(parsed)
        elif parsed.output:
            verification.write(parsed.case, parsed.output)
            print(f"{parsed.output}: {len(verification.answers(parsed.case))} answers of {parsed.case}")
        else:
            _print_case(parsed.case)
        return EXIT_RIGHT


def _print_case(name: str) -> None:
    """Print description, conventions and first answers of a case."""
    case, rows = verification.case(name), verification.answers(name)
    lines = [f"{case['about']}\n{case['source']}\n", *(f"- {line}" for line in verification.kit()["conventions"]),
             f"\n{'value':>24} unit  condition  quantity"]
    lines += [f"{answer.value:>24} {answer.unit:5} {answer.condition:<9g}  {answer.run}: {answer.quantity}"
              for answer in rows[:MAX_PRINTED_ANSWERS]]
    if len(rows) > MAX_PRINTED_ANSWERS:
        lines.append(f"… {len(rows) - MAX_PRINTED_ANSWERS} more; granular verify {name} -o FILE.json writes all of "
                     "them, and the set-up.")
    print(output.wrap_text("\n".join(lines)))


def _check_table(parsed: argparse.Namespace) -> int:
    """Check a table of another code, print the result, and return the exit code."""
    checks = verification.check(parsed.case, parsed.check, parsed.tolerance)
    count = Counter(check.word for check in checks)
    failures = [check for check in checks if check.word in ("wrong", "missing")]
    counts = ", ".join(f"{count[word]} {word}" for word in RESULT_WORDS if count[word])
    first = next((check for check in failures if check.word == "wrong"), None)
    print(f"{parsed.case}: of {len(checks)} answers {counts}.")
    if first is not None:
        print(output.wrap_text(
            f"First wrong: {first.answer.run}: {first.answer.quantity}: {files.plain_text(first.theirs)} instead of "
            f"{first.answer.value} {first.answer.unit}, relative difference {first.off:.1e}."))
    for check in [check for check in checks if check.word != "right"][:MAX_PRINTED_ANSWERS]:
        error = "" if check.word == "missing" else f" by {check.off:.1e}"
        print(f"  {check.word}{error}: {check.answer.run}: {check.answer.quantity}")
    return EXIT_NOT_RIGHT if failures else EXIT_RIGHT
