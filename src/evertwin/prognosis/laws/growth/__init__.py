"""Whether wear grows: when it began, whether it goes on, and how the level rose."""
