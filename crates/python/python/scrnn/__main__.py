"""``python -m scrnn``: the program that came with the package."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig


def program() -> str | None:
    """Where the program is: beside this Python, or nowhere."""
    name = "scrnn.exe" if os.name == "nt" else "scrnn"
    schemes = [None, *[one for one in sysconfig.get_scheme_names() if one.startswith(os.name)]]
    folders = [sysconfig.get_path("scripts") if one is None else sysconfig.get_path("scripts", one) for one in schemes]
    places = [os.path.join(folder, name) for folder in folders if folder]
    return next((place for place in places if os.access(place, os.X_OK)), None)


def main() -> int:
    """Calls it."""
    found = program()
    if found is None:
        print("the program scrnn did not come with this package: install a wheel, or cargo install scrnn-cli", file=sys.stderr)
        return 2
    return subprocess.call([found, *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
