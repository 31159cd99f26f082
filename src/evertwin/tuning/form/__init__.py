"""Numbers of a model whose form is wrong: what else they could be."""
