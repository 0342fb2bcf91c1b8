"""docs/architecture.md names what there is."""

from __future__ import annotations

import re
from pathlib import Path

from tests.test_architecture import imports_when_loaded
from worker.queues import QUEUES

ROOT = Path(__file__).parents[1]
ENGINE = ROOT / "gcvec"
PAGE = (ROOT / "docs" / "architecture.md").read_text()
FILES = [
    file for top in ("gcvec", "worker", "service", "tests", "docs") for file in (ROOT / top).rglob("*.*")
]
SOURCES = [
    file for file in FILES if file.suffix in (".py", ".js") and not file.is_relative_to(ROOT / "tests")
]
CODE = "\n".join(file.read_text() for file in SOURCES)


def test_every_file_named_exists() -> None:
    named = set(re.findall(r"[`(]([\w/]+\.(?:py|js|md))[`)]", PAGE)) - {"gcvec/export/NAME.py"}
    paths = [f"/{file.relative_to(ROOT)}" for file in FILES]
    assert len(named) > 60
    assert {name for name in named if not any(path.endswith(f"/{name}") for path in paths)} == set()


def test_every_name_of_the_code_is_one() -> None:
    named = set(re.findall(r"`(?:GCVEC_)?([A-Z]\w+|[a-z]\w*_\w+)`", PAGE)) - {"NAME"}
    assert len(named) > 30
    known = {word.lower() for word in re.findall(r"\w+", CODE)}
    assert {name for name in named if name.lower() not in known} == set()


def test_every_package_is_listed_after_those_it_needs() -> None:
    listed = re.findall(r"^\| `gcvec/(\w+)/` \|", PAGE, re.MULTILINE)
    packages = {file.parent.name for file in ENGINE.glob("*/__init__.py")}
    assert sorted(listed) == sorted(packages)
    for place, package in enumerate(listed):
        imported = (imports_when_loaded(file) for file in (ENGINE / package).glob("*.py"))
        needed = {name.split(".")[1] for names in imported for name in names} & packages
        assert needed <= set(listed[: place + 1]), package


def test_every_key_in_redis_is_listed() -> None:
    key = re.compile(r"(?<!urn:)gcvec:([a-z]+(?:-[a-z]+)*)")
    assert set(key.findall(PAGE)) == set(key.findall(CODE))
    assert all(f"`{queue}`" in PAGE for queue in QUEUES)
