"""Looking ahead: what the machine will do, what would happen if, and how long it will last.

Everything here starts from the live version and changes nothing: a forecast simulates on from the
newest measured state, a scenario simulates beside a baseline, a life reads the parameter history.
"""
