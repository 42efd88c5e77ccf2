"""``python -m anyview``."""

from anyview.cli import main

main()
