"""Which numbers move, and what is known of them."""
