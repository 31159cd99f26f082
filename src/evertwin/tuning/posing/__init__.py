"""What is asked: which parameters of which model, judged on which rows."""
