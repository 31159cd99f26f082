"""What a recording consists of: tables, their columns with names and units, scans."""
