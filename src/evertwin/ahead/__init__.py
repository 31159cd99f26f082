"""Looking ahead: what the machine will do, and what would happen if.

Everything here starts from the live version and changes nothing: a forecast simulates on from the
newest measured state, a scenario simulates beside a baseline.
"""
