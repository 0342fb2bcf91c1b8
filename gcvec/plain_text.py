"""Text from strangers, made fit for every document it may go into."""

from __future__ import annotations

import re

LONGEST_LABEL = 255
"""Characters of a label that are kept."""

_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def plain_text(text: str) -> str:
    """The text with a replacement character for each one that no XML document, or no UTF-8, can hold."""
    return _NOT_XML.sub("\ufffd", text)


def plain_label(text: str) -> str:
    """A region's label as it is stored: plain text of a sensible length."""
    return plain_text(text[:LONGEST_LABEL])
