"""Files for drives and controllers, each read back and verified as the target will interpolate it.

Imports go one way: points, formats (which find the files of the formats, one each), reconstruct, verify, exporting.
"""

from trajopt.export.exporting import Refused, export
from trajopt.export.verify import Report

__all__ = ["Refused", "Report", "export"]
