"""The friction terms that come with the package, one in each file."""
