"""The fold of a whole twin: driver, state, decisions, slow work, ledger, result. The only room that
knows all stages."""
