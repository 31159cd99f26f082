"""TOML in, frozen dataclasses out; the schema and the reference page follow from the same classes.

>>> from evertwin.config import reads
>>> reads('schema = 1\\nname = "axis"\\nmodel = { kind = "drive" }').tuning.method
'auto'
"""

from evertwin.config.read import TWIN, files_of, place, read, reads
from evertwin.config.spec import SCHEMA, TwinSpec

__all__ = ["SCHEMA", "TWIN", "TwinSpec", "files_of", "place", "read", "reads"]
