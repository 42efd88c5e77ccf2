"""``python -m anyview``."""

from anyview.cli.main import main

main()
