"""Terms of a package that is not evertwin."""
