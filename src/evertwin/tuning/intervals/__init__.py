"""What rows tell about numbers: which they determine, how closely, and what is in doubt."""
