"""What robots log: bags, CARMEN logs, and the scans and images in them."""
