"""``python -m granular`` is the `granular` command.
May be skipped: it starts the command.
"""

from granular.app.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
