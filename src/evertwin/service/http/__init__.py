"""What is asked over HTTP and the socket, and who may ask it."""
