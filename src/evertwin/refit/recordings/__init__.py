"""The fit of whole recordings, and a form sought on them: what ``evertwin fit`` does."""
