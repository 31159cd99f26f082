"""Reading XML from somebody else: no entities, no document types, no network, bounded in size.

>>> parse(b"<a><b/></a>", "x.xml").tag
'a'
>>> parse(b'<!DOCTYPE a [<!ENTITY e "boom">]><a>&e;</a>', "x.xml")
Traceback (most recent call last):
evertwin.errors.ModelError: x.xml: expected plain XML without document types and entities, got ...
"""

from __future__ import annotations

import io
from typing import Any
from xml.etree.ElementTree import ParseError

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from evertwin.errors import ModelError

SIZE = 32_000_000
"""Bytes that a description may have."""
DEPTH = 64
"""Elements inside each other."""
ELEMENTS = 500_000


def parse(text: bytes, where: str) -> Any:
    """The top element; ``where`` opens every message.

    Raises:
        ModelError: the text is no XML, too large or deep, or refers to anything outside of it.
    """
    if len(text) > SIZE:
        raise ModelError(f"{where}: expected at most {SIZE} bytes of XML, got {len(text)}")
    try:
        return _tree(text, where)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise ModelError(
            f"{where}: expected plain XML without document types and entities, got {error}"
        ) from error


def _tree(text: bytes, where: str) -> Any:
    depth = count = 0
    top: Any = None
    events = ElementTree.iterparse(io.BytesIO(text), events=("start", "end"), forbid_dtd=True)
    for event, element in events:
        top = element if top is None else top
        depth += 1 if event == "start" else -1
        count += event == "start"
        if depth > DEPTH or count > ELEMENTS:
            raise ModelError(
                f"{where}: expected at most {DEPTH} elements inside each other and {ELEMENTS} in "
                f"all, got more at <{str(element.tag)[:40]}>"
            )
    return top
