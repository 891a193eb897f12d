"""docs/paper.md: every file and name that it points to exists."""

import ast
import re
from pathlib import Path

PROJECT = Path(__file__).parents[1]
PAGE = PROJECT / "docs" / "paper.md"
POINTER = re.compile(r"`(avatargen/[\w/]+\.py)`((?:,? `\w+`)*)")


def defined_in(path: Path) -> set[str]:
    """Names of functions, classes and constants at a module's top level."""
    found: set[str] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return found


def test_every_pointer_of_the_paper_s_table_holds() -> None:
    pointers = POINTER.findall(PAGE.read_text())
    assert len(pointers) > 20
    for file, names in pointers:
        assert (PROJECT / file).is_file(), file
        wanted = set(re.findall(r"`(\w+)`", names))
        assert wanted <= defined_in(PROJECT / file), (file, wanted - defined_in(PROJECT / file))
