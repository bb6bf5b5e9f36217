"""``python -m densarm``: the command line."""

import sys

from densarm.cli import main

sys.exit(main())
