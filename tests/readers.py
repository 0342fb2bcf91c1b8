"""Programs and parts that tests need but a machine may lack."""

import os
import shutil
from typing import NoReturn

import pytest


def require(name: str, *commands: str) -> str:
    """The first of these commands that is installed. Else the test is skipped, or fails on CI."""
    for command in commands:
        if path := shutil.which(command):
            return path
    missing(f"{name} is not installed: none of {', '.join(commands)} was found")


def missing(message: str) -> NoReturn:
    """Skip the test for want of something; on CI it fails."""
    if os.environ.get("CI") == "true":
        pytest.fail(message)
    pytest.skip(message)
