"""What is tuned, on which rows, how it is judged, and the candidate that it makes."""
