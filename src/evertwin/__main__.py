"""``python -m evertwin``."""

from evertwin.app.cli import main

main()
