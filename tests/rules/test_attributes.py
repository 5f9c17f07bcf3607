"""Values of attributes: as `dynx.load` reads them."""

from __future__ import annotations

import pytest

from dynx.errors import DescriptionError
from dynx.model.elements import Pose
from dynx.model.xml.source import XmlSource
from dynx.rules.attributes import number_of, origin_of, vector_of

ELEMENT = XmlSource('<a n="1.5" v="1 2  3" bad="1,5"><origin xyz="1 2 3" rpy=""/></a>').root


def test_what_is_there() -> None:
    assert number_of(ELEMENT, "n") == 1.5
    assert vector_of(ELEMENT, "v") == (1.0, 2.0, 3.0)
    assert origin_of(ELEMENT) == Pose((1.0, 2.0, 3.0))


def test_what_is_absent() -> None:
    assert number_of(ELEMENT, "m") is None
    assert vector_of(ELEMENT, "m") is None
    assert origin_of(ELEMENT.children[0]) == Pose()


def test_what_is_no_number() -> None:
    with pytest.raises(DescriptionError, match="1: bad in <a>"):
        number_of(ELEMENT, "bad")
    with pytest.raises(DescriptionError, match="three numbers"):
        vector_of(ELEMENT, "n")
