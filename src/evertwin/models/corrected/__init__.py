"""A model with correction terms on top: still a model."""
