"""What twins say goes out: predictions with bands, residuals, health, events. Nothing of it can
write a set-point."""
