"""The laws that every model and every term keeps, as public checkers."""
