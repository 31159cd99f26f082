"""The page for the hall: a process of its own, which reads the service's public API and socket.

It holds the token; a browser never sees it. What is shown is written with this package and served
as it is: nothing is built, nothing comes from elsewhere.
"""
