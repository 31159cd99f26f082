"""The edges: command line, report, demonstration. A thin shell over `evertwin.Twin`."""
