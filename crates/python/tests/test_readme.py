"""The examples of the READMEs and of the book run as they stand."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
#: In the tree the package's, the project's and the book's page; elsewhere those that SCRNN_READMES names.
READMES = [Path(one) for one in os.environ.get("SCRNN_READMES", "").split(os.pathsep) if one] or [
    HERE.parent / "README.md",
    HERE.parents[2] / "README.md",
    HERE.parents[2] / "docs" / "book" / "src" / "python.md",
]


@pytest.mark.parametrize("readme", READMES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_python_example_runs(readme: Path) -> None:
    examples = re.findall(r"```python\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL)
    assert examples, f"{readme} has no example"
    for example in examples:
        scope: dict[str, object] = {}
        exec(compile(example, str(readme), "exec"), scope)
        assert "net" in scope
