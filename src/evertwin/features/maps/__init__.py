"""Maps and poses of whole recordings of scans."""
