"""Tables of a part on their way to `Results.write`: by name, columns and the units of columns."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

Tables = dict[str, tuple[Mapping[str, NDArray[Any]], Mapping[str, str]]]
