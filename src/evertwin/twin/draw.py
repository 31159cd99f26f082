def draw_run(*a): raise NotImplementedError
