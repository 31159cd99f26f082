"""Tables of measured data as models; tables as bodies of a room."""
