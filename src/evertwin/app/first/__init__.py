"""A first look: what recordings and speaking machines hold, and a first twin file of them."""
